"""The command line of the scripts in this folder."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from tetra_drake.errors import InputError
from tetra_drake.interrupts import heeding_interrupts


def run_script(main: Callable[[Sequence[str]], None]) -> None:
    """Runs a script with its arguments. An InputError and an interrupt end it with one line."""
    name = Path(sys.argv[0]).name
    try:
        with heeding_interrupts():
            main(sys.argv[1:])
    except InputError as error:
        sys.exit(f"{name}: {error}")
    except KeyboardInterrupt:
        sys.exit(f"{name}: interrupted; the same command goes on")
