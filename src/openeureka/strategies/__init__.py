"""Search strategies: ask which prompts to send, tell what came of them."""

from .ranking import Ranking
from .strategy import SEARCHES, Best, Eureka, SearchStrategy, asked, make, prompt_plan, sized

__all__ = ["SEARCHES", "Best", "Eureka", "Ranking", "SearchStrategy", "asked", "make", "prompt_plan", "sized"]
