"""What a person reads of a run: pages, tables, charts; and files of it for other programs."""
