"""The nine tasks of Isaac Gym, and what they share."""
