"""Builders and examples that several test modules use."""
