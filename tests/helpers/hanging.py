"""A point mass that hangs on two cables without free length, from a bar that the world holds."""

from helpers.anchored import TREES

MASS, STIFFNESS = 0.05, 40.0
HANGING = TREES["hanging"]
