"""Entry point of `python -m tetra_drake`: the command line."""

import sys

from tetra_drake.cli import main

sys.exit(main())
