"""A local page that lists runs, follows one, and takes a person's words."""
