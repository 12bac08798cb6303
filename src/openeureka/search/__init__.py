"""Search strategies: ask which prompts to send, tell what came of them."""

from .strategy import Best, Eureka, SearchStrategy, make, sized

__all__ = ["Best", "Eureka", "SearchStrategy", "make", "sized"]
