"""Texts that no author and no model would write, and what the package makes of them."""
