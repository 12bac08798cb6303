"""Where lanes run: the cores and GPUs of this machine."""
