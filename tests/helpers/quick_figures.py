"""Figures for tests of what they are written into: drawn, but written in no time."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from tetra_drake.figures import style
from tetra_drake.report.run_page import Pictures
from tetra_drake.results.result import SimulationResult

REAL = "fitness_of_trials"
"""The figure that is written as it is."""

_BLANK = '<svg xmlns="http://www.w3.org/2000/svg" width="200" height="100"><title>{}</title></svg>'

_write = style.save_figure
_drawn: set[tuple[object, ...]] = set()
"""Figures of one gait that this process has drawn: their names, and what the gait is like."""


def save_figure(figure: Figure, folder: Path, name: str, *, kinds: Sequence[str]) -> None:
    """Writes one figure as SVG, a blank picture for any other, whatever the `kinds`."""
    if name == REAL:
        _write(figure, folder, name, kinds=["svg"])
    else:
        save_blank(figure, folder, name)


def save_blank(figure: object, folder: Path, name: str, *, kinds: Sequence[str] = ()) -> None:
    """Writes a blank picture, as SVG whatever the `kinds`."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.svg").write_text(_BLANK.format(name), encoding="utf-8")


def draw_pictures(pictures: Pictures, folder: Path, printed: style.Print = style.AS_USUAL) -> None:
    """As that of run_page, but a figure of one gait is drawn for the first gait of its kind alone:
    the first of a scenario, of its actuators, and of commands or of gaits. Others are blank."""
    for part in pictures.values():
        for draw in part:
            figure, name, of = None, draw.func.__name__, _of_one_gait(draw)
            if of is None or (name, *of) not in _drawn:
                figure = draw(**vars(printed.look))
            if of is not None:
                _drawn.add((name, *of))
            save_figure(figure, folder, name, kinds=printed.kinds)


def draw_none(pictures: Pictures, folder: Path, printed: object = None) -> None:
    """As that of run_page, but all figures are blank."""
    for part in pictures.values():
        for draw in part:
            save_blank(None, folder, draw.func.__name__)


def _of_one_gait(draw: Any) -> tuple[object, ...] | None:
    """What the gait is like of which a figure is, if it is of one gait."""
    if len(draw.args) != 1 or not isinstance(draw.args[0], SimulationResult):
        return None
    result = draw.args[0]
    return result.scenario.name, result.scenario.actuation.tag, type(result.gait)
