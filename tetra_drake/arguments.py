"""Options that commands share, and types of arguments, with messages made for people."""

from __future__ import annotations

import argparse
import math

from tetra_drake.scenario.load import shipped_scenarios
from tetra_drake.scenario.schema import ENGINES


def add_scenario(command: argparse.ArgumentParser) -> None:
    """Adds the option --scenario."""
    command.add_argument(
        "--scenario",
        metavar="NAME|FILE",
        default="thesis",
        help=f"a shipped scenario ({', '.join(shipped_scenarios())}) or a YAML file "
        "(default: %(default)s)",
    )


def add_workers(command: argparse.ArgumentParser) -> None:
    """Adds the option --workers; None stands for one a core."""
    command.add_argument(
        "--workers",
        metavar="N",
        type=count,
        help="worker processes (default: one a core)",
    )


def add_engine(command: argparse.ArgumentParser) -> None:
    """Adds the option --engine."""
    command.add_argument(
        "--engine",
        choices=ENGINES,
        help="the Drake diagram; the same laws compiled end to end, many times faster; or MuJoCo, "
        "with contact and friction of its own (default: the scenario's)",
    )


def seed(text: str) -> int:
    """A seed: an integer, 0 or more."""
    return _integer(text, least=0)


def count(text: str) -> int:
    """A number of things: an integer, 1 or more."""
    return _integer(text, least=1)


def rate(text: str) -> float:
    """A rate: a finite number above 0."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"found '{text}', expected a number above 0")
    return value


def _integer(text: str, *, least: int) -> int:
    if not (text.isascii() and text.isdecimal() and int(text) >= least):
        raise argparse.ArgumentTypeError(f"found '{text}', expected an integer, {least} or more")
    return int(text)
