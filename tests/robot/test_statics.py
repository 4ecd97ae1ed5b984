"""Self-stress states and mechanisms of structures for which they are known."""

import math
from itertools import combinations, product

import numpy as np
import pytest
from helpers.structures import joined_nodes, statics_of

from tetra_drake.robot.statics import cable_wrenches
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.structure_files import read_structure


def structure(nodes, struts, cables) -> StructureFile:
    """A structure of one make of struts and one of cables, its nodes numbered."""
    make = {"diameter": 0.01, "density": 1000.0, "node_diameter": 0.02}
    spring = {"stiffness": 100.0, "damping": 1.0, "free_length": 0.0}

    def names(pairs):
        return [[f"n{a}", f"n{b}"] for a, b in pairs]

    return StructureFile(
        nodes={f"n{i}": list(map(float, p)) for i, p in enumerate(nodes)},
        struts={"strut": {"pairs": names(struts), **make}},
        cables={"cable": {"pairs": names(cables), **spring}},
    )


def prism(n: int, twist: float, *, radius=1.0, height=1.5) -> StructureFile:
    """Bottom cables, then top ones, then sides, which the twist (deg) makes slant."""
    angles = np.radians(10.0 + 360.0 / n * np.arange(n))
    tops = angles + math.radians(twist)
    bottom = np.stack([radius * np.cos(angles), radius * np.sin(angles), 0.0 * angles], axis=1)
    top = np.stack([radius * np.cos(tops), radius * np.sin(tops), height + 0.0 * tops], axis=1)
    following = [(i + 1) % n for i in range(n)]
    struts = [(i, n + following[i]) for i in range(n)]
    horizontal = [(i, following[i]) for i in range(n)]
    horizontal += [(n + i, n + following[i]) for i in range(n)]
    return structure([*bottom, *top], struts, horizontal + [(i, n + i) for i in range(n)])


def six_bar(apart: float) -> StructureFile:
    """Struts of length 1 along x, y and z, parallel ones so far apart, in a shell of 24 cables."""
    nodes, half = [], 0.5 * apart
    for axis in range(3):
        for side, end in product((-half, half), (-0.5, 0.5)):
            nodes.append(np.roll([end, side, 0.0], axis))
    struts = [(i, i + 1) for i in range(0, 12, 2)]
    lengths = {pair: np.linalg.norm(nodes[pair[0]] - nodes[pair[1]]) for pair in PAIRS}
    return structure(nodes, struts, sorted(PAIRS, key=lambda pair: lengths[pair])[:24])


PAIRS = [pair for pair in combinations(range(12), 2) if pair[0] // 4 != pair[1] // 4]
"""Nodes of struts that are not parallel."""


def nested_tetrahedra(spacing: float) -> StructureFile:
    """Two tetrahedra of the thesis and the six cables between them."""
    edge = 6 * 0.0254
    around = np.radians([120.0, 240.0, 0.0])
    r = edge / math.sqrt(3.0)
    base = np.stack([0.0 * around, r * np.sin(around), r * np.cos(around)], axis=1)
    first = np.array([*base, [edge * math.sqrt(2.0 / 3.0), 0.0, 0.0]])
    struts = list(combinations(range(4), 2))
    outer = [(i, 4 + i) for i in range(3)]
    inner = [(3, 4 + i) for i in range(3)]
    second = first + np.array([spacing, 0.0, 0.0])
    return structure(
        [*first, *second], [*struts, *((4 + a, 4 + b) for a, b in struts)], outer + inner
    )


def test_a_wrench_is_torque_about_the_origin_then_force() -> None:
    wrenches = cable_wrenches(
        p_WN=np.array([[0.0, 1.0, 2.0], [3.0, 1.0, 2.0]]),
        body_of_node=np.array([0, 1]),
        cable_ends=np.array([[0, 1]]),
    )
    assert wrenches.reshape(2, 6).tolist() == [[0, 2, -1, 1, 0, 0], [0, -2, 1, -1, 0, 0]]


@pytest.mark.parametrize(
    ("given", "self_stress_states", "mechanisms"),
    [
        (prism(3, 30.0), 1, 1),
        (prism(3, 30.00001), 1, 1),
        (prism(3, 31.0), 0, 0),
        (prism(3, 30.0, radius=1e-6, height=1.5e-6), 1, 1),
        (prism(4, 45.0), 1, 3),
        (prism(4, 30.0), 0, 2),
        (six_bar(0.5), 1, 1),
        (six_bar(0.52), 0, 0),
        (nested_tetrahedra(2.94 * 0.0254), 1, 1),
        (nested_tetrahedra(2.0 * 0.0254), 1, 1),
        (read_structure("mast"), 6, 0),  # 24 cables on four bodies are 18 equations
        (read_structure("pair"), 2, 0),  # 8 on two are 6
    ],
)
def test_self_stress_states_and_mechanisms(given, self_stress_states, mechanisms):
    statics = statics_of(given)
    assert statics.mechanisms == mechanisms
    assert statics.self_stresses.shape == (self_stress_states, len(given.all_cables))


def test_tensions_of_a_prism() -> None:
    given = prism(3, 30.0)
    (tensions,) = statics_of(given).self_stresses
    heights = [[given.nodes[node][2] for node in cable.nodes] for cable in given.all_cables]
    is_horizontal = np.ptp(heights, axis=1) == 0.0
    horizontal, side = tensions[is_horizontal], tensions[~is_horizontal]
    assert (len(horizontal), len(side)) == (6, 3)
    assert horizontal == pytest.approx(horizontal[0], rel=1e-9)
    assert side == pytest.approx(side[0], rel=1e-9)
    assert horizontal[0] / side[0] == pytest.approx(0.630, abs=5e-4)


def forces_on_bodies(given: StructureFile, tensions: np.ndarray) -> np.ndarray:
    """(6 B,) about the nodes' centre, torques in N times the size of the structure."""
    nodes = joined_nodes(given)
    p_WN = nodes["p_WN"]
    nodes["p_WN"] = (p_WN - p_WN.mean(axis=0)) / np.ptp(p_WN, axis=0).max()
    return cable_wrenches(**nodes) @ tensions


def test_self_stresses_balance() -> None:
    for given in (prism(4, 45.0), read_structure("mast")):
        for tensions in statics_of(given).self_stresses:
            assert np.abs(forces_on_bodies(given, tensions)).max() < 1e-6


@pytest.mark.parametrize("name", ["mast", "pair"])
def test_the_shipped_spines_balance_without_weight(name: str) -> None:
    given = read_structure(name)
    stiffness = np.array([given.cables[cable.group].stiffness for cable in given.all_cables])
    lengths = [
        math.dist(given.nodes[first], given.nodes[second])
        for first, second in (cable.nodes for cable in given.all_cables)
    ]
    tensions = stiffness * (np.array(lengths) - given.free_lengths)
    assert tensions.min() > 1.0
    assert np.abs(forces_on_bodies(given, tensions)).max() < 0.02 * tensions.min()


def test_the_six_cables_of_the_thesis_balance_where_its_spacing_says() -> None:
    robot = load_scenario("thesis").robot
    (tensions,) = statics_of(nested_tetrahedra(robot.spacing)).self_stresses
    outer, inner = tensions[0], tensions[3]
    assert tensions == pytest.approx([outer] * 3 + [inner] * 3, rel=1e-9)
    reach = robot.strut_length * math.sqrt(2.0 / 3.0) - robot.spacing
    slant = math.hypot(reach, robot.strut_length / math.sqrt(3.0))
    assert outer == pytest.approx(inner * reach / slant)
