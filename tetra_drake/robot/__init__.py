"""The robot as data: structure, bodies, gaits, and the constants that the laws take."""
