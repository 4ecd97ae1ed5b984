"""Lanes of numbers and the compiling decorator; nothing of robots."""
