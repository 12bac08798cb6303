"""What is seen of a run while it is at work: a table on a terminal, lines elsewhere, and its log."""
