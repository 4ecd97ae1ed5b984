"""Predictions with intervals of real structures, beside measurements; no constant is fitted.

    python runs/measured.py

Writes the page README.md and its pictures into the folder measured/. The structures and the
measurements are files there, with their sources. Predictions with intervals are kept
in measured/predictions/ as they are made, so that an interrupted run goes on; delete a file to make
its predictions again. The blind predictions in measured/blind.csv stay as they were committed.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas
from matplotlib.figure import Figure
from measured_intervals import cases, committed, kind_and_unit
from measured_intervals import predicted as intervals_of
from measured_robots import (
    AXES,
    HERE,
    JUMPER,
    fitted_free_lengths,
    jump,
    jumper,
    simplex_frequency,
    simplex_under_load,
    spine_poses,
)
from page import percent, rendered
from script import script

from tetra_drake.figures.style import (
    LINE_COLOURS,
    common_style,
    line_style,
    make_figure,
    save_figure,
)
from tetra_drake.files import write_whole
from tetra_drake.formatting import fixed
from tetra_drake.lab.predict.predict import interval_text
from tetra_drake.lab.study.statistics import json_rows

NUMBERS, INTERVALS = "numbers.json", "intervals.csv"
"""Files of the numbers that need simulations, and of the intervals beside measured values."""

# Scores


def holds(rows: pandas.DataFrame) -> pandas.Series:
    """True where an interval holds the measured value."""
    return rows["measured"].between(rows["low"], rows["high"])


class Score(NamedTuple):
    """How well predictions agree with measured values."""

    total: int
    inside: int
    """Number of intervals that hold the measured value."""
    error: str
    """Median error of the medians: of shapes in mm, of others in percent."""
    rms: float
    """Root mean square of the errors over half the widths of the intervals."""

    @classmethod
    def of(cls, rows: pandas.DataFrame) -> Score:
        """Score of rows with a median, an interval and a measured value."""
        error, half = rows["median"] - rows["measured"], (rows["high"] - rows["low"]) / 2.0
        text = percent((error / rows["measured"]).abs().median(), 1)
        if (rows["kind"] == "shape").all():
            text = f"{fixed(error.abs().median(), 1)} mm"
        rms = float(np.sqrt(((error / half) ** 2).mean()))
        return cls(len(rows), int(holds(rows).sum()), text, rms)


def totals(rows: pandas.DataFrame, by: str) -> dict[str, Score]:
    """Scores of the rows by a column. Tests with the same prediction count once in a further
    score."""
    scores = {str(name): Score.of(group) for name, group in rows.groupby(by, sort=False)}
    scores["all"] = Score.of(rows)
    once = rows.drop_duplicates(["median", "low", "high"])
    return scores | ({"all, repeated tests once": Score.of(once)} if len(once) < len(rows) else {})


BLINDEST = ("hexagonal prism", "Laika", "jumper, at rest")
"""Structures none of whose measured values were known when their tolerances were assumed."""


# Pictures

BAR: Any = {"linewidth": 3.0, "alpha": 0.5}
"""Looks of measured ranges."""


@common_style()
def intervals_figure(rows: pandas.DataFrame) -> Figure:
    """Measured values beside intervals, each in units of half the width of its interval."""
    figure, ((axes,),) = make_figure(width_in=7.0, height_in=3.0)
    deviation = 2.0 * (rows["measured"] - rows["low"]) / (rows["high"] - rows["low"]) - 1.0
    places, names = pandas.Series(0.0, index=rows.index), []
    for column, (name, group) in enumerate(rows.groupby("structure", sort=False)):
        places[group.index] = column + np.linspace(-0.4, 0.4, len(group))
        names.append(str(name).replace(", ", ",\n"))
        axes.axvline(column + 0.5, color="0.6", linewidth=0.8)
    axes.axhspan(-1.0, 1.0, color="0.9", label="90 % interval")
    for number, kind in enumerate(("force", "shape", "frequency", "motion"), start=1):
        own = rows["kind"] == kind
        color, label = LINE_COLOURS[number], f"measured {kind}"
        axes.plot(places[own], deviation[own], "o", color=color, label=label)
    axes.set_xticks(range(len(names)), names)
    axes.grid(visible=False, axis="x")
    axes.set(ylabel="place in the interval (ends: -1, 1)", ylim=(-3.0, 8.0))
    axes.margins(x=0.02)
    axes.legend(framealpha=1.0, ncols=3, loc="upper left")
    return figure


@common_style()
def simplex_figure(under_load: pandas.DataFrame) -> Figure:
    """Height and cable forces of the simplex over the load."""
    figure, ((heights, forces),) = make_figure(width_in=7.0, height_in=3.2, columns=2)
    forces_of = {"CV": "vertical", "CB": "bottom", "CT": "top"}
    for axes, kinds in ((heights, {"H": "upper nodes"}), (forces, forces_of)):
        for number, (kind, label) in enumerate(kinds.items()):
            axes.plot(under_load["load"], under_load[kind], label=label, **line_style(number))
            ends = (under_load[f"{kind} {end}"] for end in ("least", "greatest"))
            axes.vlines(under_load["load"], *ends, color=LINE_COLOURS[number], **BAR)
        axes.vlines([], 0.0, 0.0, color="black", label="measured", **BAR)
        axes.set_xlabel("load per upper node, kN")
        axes.margins(x=0.03)
        axes.legend(frameon=False)
    heights.set_ylabel("height, mm")
    forces.set_ylabel("tension, kN")
    return figure


@common_style()
def spine_figure(poses: pandas.DataFrame) -> Figure:
    """Paths of the spine's vertebra in its tests: predicted, wanted and seen by the camera."""
    figure, ((place, angle),) = make_figure(width_in=7.0, height_in=3.2, columns=2)
    line = {"linestyle": "-", "color": LINE_COLOURS[1], "linewidth": 2.0}
    dots = {"linestyle": "", "marker": ".", "color": LINE_COLOURS[2], "markersize": 3.0}
    for _, test in poses.groupby("test"):
        for begin, style in {"predicted_": line, "": dots}.items():
            x, y, turn = (test[f"{begin}{column}"] / size for column, size in AXES.values())
            place.plot(x, y, **style)
            angle.plot(test["step"], turn, **style)
    place.margins(x=0.03)
    angle.margins(x=0.03)
    place.set(xlabel="x, mm", ylabel="y, mm")
    angle.set(xlabel="set of cable lengths", ylabel="angle, degrees")
    above: Any = {"frameon": False, "ncols": 2, "loc": "outside upper center"}
    figure.legend(angle.lines[:2], ["predicted", "camera"], **above)
    return figure


@common_style()
def jump_figure(jumps: dict[float, list[tuple[float, float]]]) -> Figure:
    """Rise of the jumper over the share that is wound up."""
    figure, ((axes,),) = make_figure(width_in=5.0, height_in=3.2)
    shares = 100.0 * np.array(list(jumps))
    for number, damping in enumerate(JUMPER["dampings"]):
        rises = [results[number][0] for results in jumps.values()]
        style = line_style(number + 1)
        axes.plot(shares, rises, marker="o", label=f"springs damped by {damping:g} N s/m", **style)
    ends = np.transpose([*JUMPER["rises"].values()])
    wide: Any = {"color": "black", "linewidth": 6.0, "alpha": 0.4}
    axes.vlines(shares, *ends, **wide)
    axes.plot([], [], label="measured", **wide)
    axes.margins(x=0.03)
    axes.set(xlabel="wound up by, %", ylabel="rise of the centre, m")
    axes.legend(frameon=False)
    return figure


def measured_rows() -> dict[str, pandas.DataFrame]:
    """Predictions that have a measured value: those whose measured values were known, the blind
    ones as they were committed, and predictions of the same quantities made anew."""
    found = {name: intervals_of(name, case) for name, case in cases().items()}
    blind = committed()
    spine = found["spine"]
    found["spine"] = spine[~spine["quantity"].isin(blind["quantity"])]
    anew = pandas.concat([rows for name, rows in found.items() if name.startswith("anew_")])
    known = pandas.concat(
        [rows for name, rows in found.items() if not name.startswith(("anew_", "blind_"))]
    )
    rows = {**found, "known": known, "blind": blind, "anew": anew}
    rows = {name: each.dropna(subset="measured") for name, each in rows.items()}
    return {
        name: each.reset_index(drop=True).assign(inside=holds(each).to_numpy())
        for name, each in rows.items()
    }


def of_simulations(
    under_load: pandas.DataFrame, poses: pandas.DataFrame, jumps: Mapping[float, Sequence[Any]]
) -> dict[str, Any]:
    """Numbers of the page that need simulations, apart from its three figures."""
    steps = [int(np.abs(under_load["load"] - load).argmin()) for load in (0.0, 0.3, 0.6, 1.0, 2.1)]
    apart: dict[str, Any] = {}
    for axis, (column, size) in AXES.items():
        predicted = poses[f"predicted_{column}"]
        wanted = float((predicted - poses[f"wanted_{column}"]).abs().max()) / size
        camera = (poses[column] - predicted) / size
        label = f"{axis}, {kind_and_unit(axis)[1]}"
        apart[label] = {"wanted": wanted, "camera": [camera.mean(), camera.min(), camera.max()]}
    fit = fitted_free_lengths("top", "vertical").parameters
    return {
        "under_load": json_rows(under_load.iloc[steps]),
        "apart": apart,
        "jumps": {f"{100.0 * share:.0f}": results for share, results in jumps.items()},
        "free_lengths": json_rows(fit[["value", "start", "low", "high"]].rename_axis("key")),
        "frequencies": [simplex_frequency(stress) for stress in (1.5, 2.5)],
    }


def shortened(shares: object) -> str:
    """Names of the largest shares, with the first of each list; a cell may be empty."""
    text = shares if isinstance(shares, str) else ""
    return re.sub(r"(, robot\.[^,;% ]+)+", " and others", text).replace("robot.", "")


def table(rows: pandas.DataFrame) -> str:
    """Intervals beside measured values as CSV."""
    columns = ["structure", "quantity", "unit", "median", "low", "high", "measured", "inside"]
    return str(rows[[*columns, "mostly from"]].to_csv(index=False, float_format="%.6g"))


def page(simulated: Mapping[str, Any], rows: Mapping[str, pandas.DataFrame]) -> str:
    """Text of the page from of_simulations() and measured_rows()."""
    return rendered(
        "measured.md",
        **simulated,
        rises=[*JUMPER["rises"].values()],
        rows=rows,
        totals_of=totals,
        score_of=Score.of,
        blindest=BLINDEST,
        hash=hashlib.sha256((HERE / "blind.csv").read_bytes()).hexdigest(),
        interval_text=interval_text,
        shortened=shortened,
    )


@script
def main(_: Sequence[str] = ()) -> None:
    """Writes the page, the numbers of simulations and the pictures."""
    rows, under_load, poses = measured_rows(), simplex_under_load(), spine_poses()
    jumpers = [jumper(damping) for damping in JUMPER["dampings"]]
    jumps = {share: [jump(each, share) for each in jumpers] for share in JUMPER["rises"]}
    figures = {
        "simplex": simplex_figure(under_load),
        "spine": spine_figure(poses),
        "jumper": jump_figure(jumps),
        "intervals": intervals_figure(rows["known"]),
        "blind": intervals_figure(rows["blind"]),
    }
    for name, figure in figures.items():
        save_figure(figure, HERE, name, kinds=["svg"])
    simulated = of_simulations(under_load, poses, jumps)
    write_whole(HERE / NUMBERS, json.dumps(simulated, indent=1) + "\n")
    write_whole(HERE / INTERVALS, table(rows["known"]))
    write_whole(HERE / "README.md", page(simulated, rows))
