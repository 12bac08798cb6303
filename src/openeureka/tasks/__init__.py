"""What a task is, how it is stepped, found and drafted; the tasks themselves are in `suite`."""
