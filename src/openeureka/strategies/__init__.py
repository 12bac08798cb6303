"""Search strategies: ask which prompts to send, tell what came of them."""

from .ranking import Ranking
from .strategy import Best, Eureka, SearchStrategy, make, sized

__all__ = ["Best", "Eureka", "Ranking", "SearchStrategy", "make", "sized"]
