"""openeureka: a language model designs reinforcement-learning rewards, a population of policies judges them."""

__version__ = "0.1.0"
