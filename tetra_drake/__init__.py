"""A Drake model of a walking tensegrity robot driven by a Matsuoka central pattern generator."""

__version__ = "0.1.0"
