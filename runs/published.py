"""Motions on the ground of a published MuJoCo model, in MuJoCo and converted: published/README.md.

    python runs/published.py MODEL.xml

The model is 3prism_real_upscaled_all_cables.xml of N. Chen's tensegrity_diff_physics_public
(GitHub, commit 1ac6d7b), beside its folder common/. It has no licence, so it is not stored here.
"""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from matplotlib.figure import Figure
from page import rendered
from script import read_settings, script

import tetra_drake as td
from tetra_drake.errors import InputError
from tetra_drake.figures.style import save_figure
from tetra_drake.files import read_text, write_whole
from tetra_drake.lab.bridges.conversion import converted
from tetra_drake.lab.bridges.formats import save_structure

OUT = Path(__file__).parent / "published"
TIMES = np.linspace(0.0, 4.0, 401)
SHOWN = (0.1, 0.5, 1.0, 2.0, 4.0)
ENDS = ["s0", "s1", "s2", "s3", "s4", "s5"]
"""Ends of the three rods."""


@dataclass(frozen=True)
class Motion:
    """A motion at TIMES: positions of the ends (401, 6, 3) in m, greatest tension (401,) in N."""

    ends: np.ndarray
    tension: np.ndarray


def readable(model: Path) -> str:
    """Text of the model without settings that MuJoCo no longer knows. All its bodies are at the
    origin, where global coordinates are local ones."""
    text = read_text(model, "model").replace(' coordinate="global"', "")
    return text.replace('sensornoise="disable"', "")


def by_mujoco(
    file: Path, start: Any, *, step: float, pull_only: bool, stiffer: float = 1.0
) -> Motion:
    """Motion that MuJoCo computes. With `pull_only`, tendons neither push nor damp while slack.
    `stiffer` multiplies the stiffness of contacts; their damping ratio stays."""
    model = mujoco.MjModel.from_xml_path(str(file))
    model.opt.timestep = step
    model.geom_solref *= [stiffer, np.sqrt(stiffer)]
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    centre, spin = data.subtree_com[0].copy(), np.array(start["spin"])
    position, velocity = data.qpos.reshape(3, 7)[:, :3], data.qvel.reshape(3, 6)
    velocity[:, :3] = start["velocity"] + np.cross(spin, position - centre)
    velocity[:, 3:] = spin
    ends = [model.site(name).id for name in ENDS]
    stiffnesses, dampings = model.tendon_stiffness.copy(), model.tendon_damping.copy()

    def loads() -> tuple[np.ndarray, np.ndarray]:
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        stretch = data.ten_length - model.tendon_lengthspring[:, 1]
        return stretch, stiffnesses * stretch + dampings * data.ten_velocity

    moved, tensions = [], []
    for time in TIMES:
        while data.time < time - 0.5 * step:
            if pull_only:
                stretch, tension = loads()
                pulls = (stretch > 0.0) & (tension > 0.0)
                model.tendon_stiffness[:] = np.where(pulls, stiffnesses, 0.0)
                model.tendon_damping[:] = np.where(pulls, dampings, 0.0)
            mujoco.mj_step(model, data)
        tensions.append(loads()[1].max())
        moved.append(data.site_xpos[ends].copy())
    return Motion(np.array(moved), np.array(tensions))


def by_tetra_drake(structure: Path, start: Any, world: Any, engine: str) -> Motion:
    """Motion of the converted structure on an engine."""
    robot = {"robot": f"!Structure {{file: {structure.resolve()}}}"}
    units = {"velocity": "m/s", "spin": "rad/s"}
    given = {key: [f"{x} {units[key]}" for x in value] for key, value in start.items()}
    changes = robot | {"robot.start": given | {"rest": False}} | world | {"engine": engine}
    scenario = td.load_scenario("mast").with_changes(changes)
    still = np.zeros(6)
    result = td.simulate(
        scenario, controller=lambda time, readings: still, control_period=0.1, record=True
    )
    recorded = result.trajectory
    seen = recorded.interp(time=TIMES.clip(max=float(recorded.time[-1])))
    return Motion(seen.p_WN.sel(node=ENDS).values, seen.tension.max("cable").values)


def compared(by_name: dict[str, Motion]) -> dict[str, Any]:
    """Mean distances of the ends (mm) from MuJoCo's with stiffer contacts, at SHOWN, and the
    way of their centre (m), by motion; greatest tension (kN) of the motion and at its end."""
    reference = by_name["MuJoCo, stiffer"]
    rows = {}
    for name, motion in by_name.items():
        apart = np.linalg.norm(motion.ends - reference.ends, axis=2).mean(axis=1)
        way = (motion.ends[-1] - motion.ends[0]).mean(axis=0)
        rows[name] = {
            "apart_mm": (1e3 * np.interp(SHOWN, TIMES, apart)).tolist(),
            "way_m": way.tolist(),
            "tensions_kN": [float(motion.tension.max() / 1e3), float(motion.tension[-1] / 1e3)],
        }
    return rows


def motions(model: Path, structure: Path, start: Any, settings: Any) -> dict[str, Motion]:
    """Motions from a start, by name: of the model in MuJoCo, of the converted structure here."""
    by_name = {
        "MuJoCo": by_mujoco(model, start, step=1e-3, pull_only=False),
        "MuJoCo, cables": by_mujoco(model, start, step=1e-4, pull_only=True),
        "MuJoCo, stiffer": by_mujoco(model, start, step=1e-4, pull_only=True, stiffer=10.0),
    }
    for name, engine in settings["engines"].items():
        by_name[name] = by_tetra_drake(structure, start, settings["world"], engine)
    return by_name


def figure(motions_of: dict[str, dict[str, Motion]]) -> Figure:
    """Paths of the ends' centre over the ground, and its height, a row per start."""
    page = Figure(figsize=(9.0, 5.5), layout="constrained")
    rows = page.subplots(len(motions_of), 2, squeeze=False)
    for (start, by_name), (path, height) in zip(motions_of.items(), rows, strict=True):
        for name, motion in by_name.items():
            x, y, z = motion.ends.mean(axis=1).T
            path.plot(x, y, label=name)
            height.plot(TIMES, z)
        path.set(title=start, xlabel="x (m)", ylabel="y (m)")
        height.set(xlabel="time (s)", ylabel="z (m)")
    rows[0][0].legend()
    return page


@script
def main(arguments: Sequence[str]) -> None:
    if len(arguments) != 1:
        raise InputError("MODEL.xml", "", f"found {len(arguments)} files, expected one")
    settings, model = read_settings(OUT / "settings.yaml"), Path(arguments[0])
    motions_of = {}
    with tempfile.TemporaryDirectory() as folder:
        copy, structure = Path(folder) / model.name, Path(folder) / "converted.yaml"
        write_whole(copy, readable(model))
        shutil.copytree(model.parent / "common", copy.parent / "common")
        save_structure(converted(copy), structure, source=model.name)
        for name, start in settings["starts"].items():
            motions_of[name] = motions(copy, structure, start, settings)
    save_figure(figure(motions_of), OUT, "paths", kinds=["svg"])
    numbers = {start: compared(by_name) for start, by_name in motions_of.items()}
    write_whole(OUT / "numbers.json", json.dumps(numbers, indent=1))
    write_whole(OUT / "README.md", rendered("published.md", starts=numbers))
