"""What a person sees of a run: pages, pictures, videos."""
