"""Self-stress states and mechanisms of structures for which they are known."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tetra_drake.lab.study.statics import cable_wrenches, find_statics
from tetra_drake.scenario.blueprint import Blueprint, Segments
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.structure_files import read_structure


def straight(ends: np.ndarray) -> Segments:
    return Segments(ends, np.arange(len(ends)))


def prism(n: int, twist: float, *, radius: float = 1.0, height: float = 1.5) -> Any:
    """Bottom cables, then top ones, then sides, which the twist (deg) makes slant."""
    angles = np.radians(10.0 + 360.0 / n * np.arange(n))
    angles = np.append(angles, angles + math.radians(twist))
    heights = np.repeat([0.0, height], n)
    here, following = np.arange(n), (np.arange(n) + 1) % n
    ends = np.stack([here, following], axis=1)
    return SimpleNamespace(
        p_WN=np.stack([radius * np.cos(angles), radius * np.sin(angles), heights], axis=1),
        # A strut leads from each node below to the one above the next.
        carriers=np.append(here, (here - 1) % n),
        segments=straight(np.concatenate([ends, n + ends, np.stack([here, n + here], axis=1)])),
        held=np.zeros((2 * n, 3), dtype=bool),
        joints=np.empty((0, 2), dtype=int),
    )


def nested_tetrahedra(spacing: float) -> Blueprint:
    """Two tetrahedra of the thesis and the cables between them: three outer, three inner ones."""
    changes = {"robot.tetrahedra": 2, "robot.spacing": f"{spacing} m"}
    return load_scenario("thesis").with_changes(changes).robot.blueprint()


def shipped(name: str) -> Blueprint:
    return read_structure(name).blueprint()


def forces_on_bodies(joined: Any, tensions: np.ndarray) -> np.ndarray:
    """(6 B, ...) about the nodes' centre, torques in N times the size of the structure."""
    p_WN = joined.p_WN
    scaled = (p_WN - p_WN.mean(axis=0)) / np.ptp(p_WN, axis=0).max()
    segments, bodies = joined.segments, joined.carriers
    return cable_wrenches(p_WN=scaled, body_of_node=bodies, segments=segments) @ tensions


KNOWN = [(prism(3, 30.0), 1, 1), (prism(3, 31.0), 0, 0), (prism(4, 45.0), 1, 3)]
KNOWN += [(prism(3, 30.0, radius=1e-6, height=1.5e-6), 1, 1), (shipped("six_bar"), 1, 1)]
KNOWN += [(nested_tetrahedra(2.0 * 0.0254), 1, 1)]
# 24 cables on four bodies are 18 equations, 8 on two are 6.
KNOWN += [(shipped("mast"), 6, 0), (shipped("pair"), 2, 0)]


@pytest.mark.parametrize(("joined", "self_stress_states", "mechanisms"), KNOWN)
def test_self_stress_states_and_mechanisms(joined, self_stress_states, mechanisms):
    statics = find_statics(joined, joined.p_WN)
    assert statics.mechanisms == mechanisms
    assert statics.self_stresses.shape == (self_stress_states, len(joined.segments.ends))
    balance = forces_on_bodies(joined, statics.self_stresses.T)
    assert np.abs(balance).max(initial=0.0) < 1e-6


@pytest.mark.parametrize("name", ["mast", "pair"])
def test_the_shipped_spines_balance_without_weight(name: str) -> None:
    blueprint = shipped(name)
    laws = np.array([[law["stiffness"], law["free_length"]] for law in blueprint.cable_laws])
    spans = blueprint.p_WN[blueprint.segments.ends]
    tensions = laws[:, 0] * (np.linalg.norm(spans[:, 1] - spans[:, 0], axis=1) - laws[:, 1])
    assert tensions.min() > 1.0
    assert np.abs(forces_on_bodies(blueprint, tensions)).max() < 0.02 * tensions.min()
