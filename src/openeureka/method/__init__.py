"""The parts that `loop.py` puts together, from prompts to the race for the crown."""
