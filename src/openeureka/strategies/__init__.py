"""Search strategies: which rewards the next prompts show and ask to improve."""

from .ranking import Ranking
from .strategy import SEARCHES, Best, Eureka, SearchStrategy, asked, make, prompt_plan, sized

__all__ = ["SEARCHES", "Best", "Eureka", "Ranking", "SearchStrategy", "asked", "make", "prompt_plan", "sized"]
