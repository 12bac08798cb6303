"""The parts that `loop.py` puts together, from prompts to the final race."""
