"""Robot as data: structure, bodies, gaits, and the constants of the physical laws."""
