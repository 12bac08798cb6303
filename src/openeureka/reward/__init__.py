"""From the text of a reward program to a graph of allow-listed tensor operations."""
