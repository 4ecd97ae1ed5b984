"""Optimisers behind ask/tell, and their operators."""
