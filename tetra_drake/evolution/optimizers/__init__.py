"""Optimisers behind ask/tell."""
