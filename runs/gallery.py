"""A folder for any host of static files: all recorded runs, whose pictures open replays.

    python runs/gallery.py [FOLDER]

Writes index.html into the folder, by default out/gallery, with the pictures of the runs and a
replay of each best gait. The replays share the viewer meshcat.js.
"""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Sequence
from pathlib import Path

from page import rendered
from record import EXPERIMENTS, PICTURE, best_walk
from script import read_settings
from tables import HERE, best_of_all, load_all

from tetra_drake.files import write_whole
from tetra_drake.report.result_folder import REPLAY

OUT, VIEWER = Path("out/gallery"), "meshcat.js"
FIGURES: dict[str, str] = read_settings(HERE / "gallery.yaml")
"""Figures of other pages, with what they show."""


def save_replays(folder: Path, names: Sequence[str]) -> None:
    """Simulates the best gaits of runs on the compiled engine and writes their replays into the
    folder, each in a folder of the run's name."""
    for name in names:
        best_walk(HERE / name).save_replay(folder / name / REPLAY, viewer=folder / VIEWER)


def save_gallery(folder: Path, names: Sequence[str]) -> None:
    """Writes the gallery of runs into a folder."""
    save_replays(folder, names)
    for file in (*FIGURES, *(f"{name}/{PICTURE}" for name in names)):
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(HERE / file, folder / file)
    bests = {name: best for name, best in best_of_all(load_all()).items() if name in names}
    files = {"replay": REPLAY, "picture": PICTURE, "figures": FIGURES}
    write_whole(folder / "index.html", rendered("index.html", bests=bests, **files))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, default=OUT)
    parser.add_argument("--replays", action="store_true", help="only the replays")
    arguments = parser.parse_args()
    save = save_replays if arguments.replays else save_gallery
    save(arguments.folder, [*EXPERIMENTS])
