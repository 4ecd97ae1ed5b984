"""Self-stress states and mechanisms of structures for which they are known. The corpus has more."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tetra_drake.lab.study.statics import cable_wrenches, find_statics
from tetra_drake.scenario.blueprint import Blueprint
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.structure_files import read_structure


def forces_on_bodies(blueprint: Blueprint, tensions: np.ndarray) -> np.ndarray:
    """(6 B, ...) about the nodes' centre, torques in N times the size of the structure."""
    p_WN = blueprint.p_WN
    scaled = (p_WN - p_WN.mean(axis=0)) / np.ptp(p_WN, axis=0).max()
    bodies, segments = blueprint.carriers, blueprint.segments
    return cable_wrenches(p_WN=scaled, body_of_node=bodies, segments=segments) @ tensions


SPACED = load_scenario("thesis").with_changes({"robot.tetrahedra": 2, "robot.spacing": "2 in"})
KNOWN = {"prism": (1, 1), "six_bar": (1, 1), "mast": (6, 0), "pair": (2, 0), "thesis": (1, 1)}
"""24 cables on four bodies of a mast are 18 equations, 8 on two of a pair are 6. Between two
tetrahedra of the thesis are three outer and three inner cables."""


@pytest.mark.parametrize("size", [1.0, 1e-6])
@pytest.mark.parametrize("name", KNOWN)
def test_self_stress_states_and_mechanisms(name, size):
    blueprint = (SPACED.robot if name == "thesis" else read_structure(name)).blueprint()
    statics = find_statics(blueprint, size * blueprint.p_WN)
    assert (len(statics.self_stresses), statics.mechanisms) == KNOWN[name]
    assert statics.self_stresses.shape[1] == len(blueprint.cable_names)
    balance = forces_on_bodies(blueprint, statics.self_stresses.T)
    assert np.abs(balance).max() < 1e-6


def test_a_prism_that_is_turned_a_degree_further_has_neither():
    blueprint = read_structure("prism").blueprint()
    p_WN = blueprint.p_WN.copy()
    is_upper = p_WN[:, 2] > 0.1
    p_WN[is_upper] = Rotation.from_euler("z", 1.0, degrees=True).apply(p_WN[is_upper])
    statics = find_statics(blueprint, p_WN)
    assert (len(statics.self_stresses), statics.mechanisms) == (0, 0)


@pytest.mark.parametrize("name", ["mast", "pair"])
def test_the_shipped_spines_balance_without_weight(name: str) -> None:
    blueprint = read_structure(name).blueprint()
    laws = np.array([[law.stiffness, law.free_length] for law in blueprint.cable_laws])
    spans = blueprint.p_WN[blueprint.segments.ends]
    tensions = laws[:, 0] * (np.linalg.norm(spans[:, 1] - spans[:, 0], axis=1) - laws[:, 1])
    assert tensions.min() > 1.0
    balance = forces_on_bodies(blueprint, tensions)
    assert np.abs(balance).max() < 0.02 * tensions.min()
