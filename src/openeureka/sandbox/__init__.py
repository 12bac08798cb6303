"""The confined process in which generated Python runs once."""
