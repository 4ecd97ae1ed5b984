"""Pictures of a model and of what it did."""
