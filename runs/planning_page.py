"""Page and pictures of the planned rover, from its records; see planning.py."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from page import rendered
from record import load_times
from records import read
from script import read_settings

from tetra_drake.figures.style import save_figure
from tetra_drake.files import write_whole
from tetra_drake.results.result import SimulationResult

HERE = Path(__file__).parent / "planning"
RECORDS, FILM = "records.jsonl", "slalom.gif"
GIVEN: dict[str, Any] = read_settings(HERE / "episodes.yaml")
"""What is run, see the file."""
GROUPS = [*dict.fromkeys(row["group"] for row in GIVEN["episodes"])]
"""Groups of episodes, in the order of the runs."""
FRAME = 0.3
"""Time (s) between the film's pictures."""

Record = dict[str, Any]
"""Record of an episode; see planning.recorded()."""


def load_records(folder: Path) -> dict[tuple[str, str], Record]:
    """Records in a folder by group and name of the episode. A line that an interruption has cut
    off does not count."""
    return {(record["group"], record["name"]): record for record in read(folder / RECORDS)}


def centre_of(p_WN: np.ndarray) -> np.ndarray:
    """Horizontal centre (..., 2) of nodes (..., nodes, 3)."""
    return np.asarray(p_WN[..., :2].mean(axis=-2))


# The film


def film(result: SimulationResult, record: Record, file: Path) -> None:
    """Writes a GIF of a robot on its way among pillars, seen from above, at twice its speed."""
    nodes, structure = result.trajectory.p_WN.values[..., :2], result.robot.structure
    instants = np.arange(0.0, result.duration, FRAME)
    samples = np.searchsorted(result.trajectory.time.values, instants)
    figure = Figure(figsize=(7.0, 2.5), dpi=70)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    draw_way(axes, record)
    cables = LineCollection([], color="0.6", linewidth=0.6)
    struts = LineCollection([], color="black", linewidth=1.8)
    axes.add_collection(cables)
    axes.add_collection(struts)
    axes.set(xlim=(-0.5, 6.5), ylim=(-1.4, 1.1), aspect="equal")
    axes.set_axis_off()

    def draw(sample: int) -> list[Artist]:
        cables.set_segments(nodes[sample][structure.segments.ends])
        struts.set_segments(nodes[sample][structure.struts])
        return [cables, struts]

    motion = FuncAnimation(figure, draw, samples)
    motion.save(str(file), PillowWriter(fps=round(2.0 / FRAME)))


# The page


def draw_way(axes: Axes, record: Record) -> None:
    """Draws the path of an episode, with circles around the places to pass and at the pillars."""
    axes.plot(*np.transpose(record["path"]), linewidth=0.8)
    for place in record["places"]:
        axes.add_patch(Circle(place, GIVEN["near"], color="0.8", zorder=0))
    for place in record["pillars"]:
        axes.add_patch(Circle(place, GIVEN["pillar"], color="C1"))


def goals_figure(groups: Mapping[str, Sequence[Record]]) -> Figure:
    """Paths to the goals, a panel for each group."""
    figure = Figure(figsize=(8.0, 3.0), layout="constrained")
    panels = figure.subplots(1, len(groups))
    for axes, (name, records) in zip(panels, groups.items(), strict=True):
        for record in records:
            draw_way(axes, record)
        axes.set(title=name, aspect="equal", xlim=(-3.6, 3.6), ylim=(-3.6, 3.6), xlabel="x (m)")
    panels[0].set(ylabel="y (m)")
    return figure


def courses_figure(records: Sequence[Record]) -> Figure:
    """Paths among pillars."""
    figure = Figure(figsize=(8.0, 6.6), layout="constrained")
    names = [record["name"] for record in records]
    cells = [*(names[:1] or ["."]) * (12 - len(names[1:])), *names[1:]]  # the slalom is wider
    panels = figure.subplot_mosaic(np.reshape(cells, (3, 4)).tolist())
    for record in records:
        axes = panels[record["name"]]
        draw_way(axes, record)
        axes.set_title(record["name"], fontsize="medium")
        axes.set_aspect("equal", adjustable="datalim")
        axes.autoscale_view()
        axes.tick_params(labelsize=7)
    figure.supxlabel("x (m)", fontsize="medium")
    figure.supylabel("y (m)", fontsize="medium")
    return figure


def speeds(records: Sequence[Record], name: str) -> np.ndarray:
    """Median, least and greatest body lengths per second of the episodes whose names begin so."""
    found = [each["relative_speed"] for each in records if each["name"].startswith(name)]
    return np.percentile(found or [math.nan], [50, 0, 100])


def costs(records: Sequence[Record], key: str, limit: float) -> dict[str, float]:
    """Number of decisions in episodes and numbers of their times (s), with the share within a limit
    (s)."""
    times = np.concatenate([record[key] for record in records])
    found = {"count": len(times), "kept": float(np.mean(times <= limit))}
    return found | {"median": np.median(times), "mean": times.mean(), "most": times.max()}


def write_page(folder: Path, episodes: Sequence[Any]) -> None:
    """Writes the page of the records in a folder, and its pictures. `episodes` are all there are,
    see planning.Episode."""
    known = load_records(folder).items()
    groups = {group: [each for (of, _), each in known if of == group] for group in GROUPS}
    goals = {name: records for name, records in groups.items() if name.startswith("goals")}
    save_figure(goals_figure(goals), folder, "goals", kinds=["svg"])
    save_figure(courses_figure(groups["courses"]), folder, "courses", kinds=["svg"])
    text = rendered(
        "planning.md",
        given=GIVEN,
        episodes=episodes,
        groups=groups,
        goals=goals,
        costs=costs,
        found=partial(speeds, groups["speeds"]),
        evolved=load_times(HERE.parent)["rolling"]["cores_s"],
    )
    write_whole(folder / "README.md", text)
