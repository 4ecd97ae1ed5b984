"""Page and pictures of the planned rover, from its records; see planning.py."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from page import rendered
from PIL import Image
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
FRAME, COLOURS = 0.2, 12
"""Time between the film's pictures in s, and number of their colours."""
VIEW, TALL = math.radians(40.0), 0.6
"""Angle (rad) from the horizontal at which the film looks down, and height (m) of its pillars."""

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


def film(result: SimulationResult, pillars: Sequence[Sequence[float]], file: Path) -> None:
    """Writes a GIF of a robot among pillars, seen obliquely, at twice its speed."""
    structure, trajectory = result.robot.structure, result.trajectory
    times, nodes = trajectory.time.values, trajectory.p_WN.values
    path = _seen(np.pad(centre_of(nodes), ((0, 0), (0, 1))))
    figure = Figure(figsize=(5.6, 2.1))
    canvas, pictures = FigureCanvasAgg(figure), []
    ends = structure.segments.ends
    for sample in np.searchsorted(times, np.arange(0.0, result.duration, FRAME)):
        figure.clear()
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.plot(*path[: sample + 1].T, color="C0", linewidth=0.8)
        seen = _seen(nodes[sample])
        behind = centre_of(nodes[sample])[1]
        for x, y in pillars:
            draw_pillar(axes, x, y, zorder=1 if y > behind else 4)
        axes.plot(*seen[ends].transpose(2, 1, 0), color="0.6", linewidth=0.6, zorder=2)
        struts = seen[structure.struts].transpose(2, 1, 0)
        axes.plot(*struts, color="black", linewidth=1.8, zorder=3)
        axes.set(xlim=(-0.5, 6.5), ylim=(-1.2, 1.42), aspect="equal")
        axes.set_axis_off()
        canvas.draw()
        picture = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
        pictures.append(picture.quantize(COLOURS))
    pace = round(500.0 * FRAME)
    pictures[0].save(file, save_all=True, append_images=pictures[1:], duration=pace, loop=0)


def _seen(points: np.ndarray) -> np.ndarray:
    """Places (..., 2) in a picture of points (..., 3) seen obliquely from above."""
    across = math.sin(VIEW) * points[..., 1] + math.cos(VIEW) * points[..., 2]
    return np.stack([points[..., 0], across], axis=-1)


def draw_pillar(axes: Axes, x: float, y: float, *, zorder: float) -> None:
    """Draws a pillar at a place, seen obliquely."""
    around = np.linspace(0.0, math.tau, 40)
    ring = np.stack(
        [x + GIVEN["pillar"] * np.cos(around), y + GIVEN["pillar"] * np.sin(around)], axis=-1
    )
    low, high = (_seen(np.pad(ring, ((0, 0), (0, 1)), constant_values=z)) for z in (0.0, TALL))
    outline = np.vstack([low[20:], high[:21]])
    axes.fill(*outline.T, color="C1", zorder=zorder)
    axes.fill(*high.T, color="C1", edgecolor="white", zorder=zorder + 0.1)


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
    groups: dict[str, list[Record]] = {group: [] for group in GROUPS}
    for (group, _), record in load_records(folder).items():
        groups[group].append(record)
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
        evolved=load_times(HERE.parent)["rolling"]["evolution"]["cores_s"],
    )
    write_whole(folder / "README.md", text)
