"""Quality diversity: its optimiser, and maps of gaits."""
