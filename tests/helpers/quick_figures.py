"""Figures for tests of what they are written into: drawn, but written in no time."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from tetra_drake.figures import style

REAL = "fitness_of_trials"
"""The figure that is written as it is."""

_BLANK = '<svg xmlns="http://www.w3.org/2000/svg" width="200" height="100"><title>{}</title></svg>'


def save_figure(figure: Figure, folder: Path, name: str, *, kinds: Sequence[str]) -> None:
    """Writes one figure as SVG, a blank picture for any other, whatever the `kinds`."""
    if name == REAL:
        style.save_figure(figure, folder, name, kinds=["svg"])
    else:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{name}.svg").write_text(_BLANK.format(name), encoding="utf-8")
