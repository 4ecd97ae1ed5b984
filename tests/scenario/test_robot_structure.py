"""Structure files: what is read from them, and what is refused."""

import numpy as np
import pytest
from helpers.files import SMALL, structure_of

from tetra_drake.scenario.structure_files import read_structure

IN = 0.0254


def test_a_structure_has_what_its_file_says_in_si() -> None:
    given = structure_of("small")
    assert given.nodes["g"] == pytest.approx([0.09, 0.02, 10 * IN])
    assert given.nodes["e"] == pytest.approx([0.02, 0.02, 0.15])
    arm, side = given.struts["arm"], given.cables["side"]
    assert (arm.diameter, arm.node_diameter) == (0.008, 0.016)
    assert arm.density == pytest.approx(1200.0)
    assert (side.stiffness, side.damping, side.free_length) == (200.0, 3.0, 0.02)
    assert (given.masses, given.gravity) == ({"g": 0.02}, 9.80665)
    # Bodies are what struts connect; a node has the sphere of its first strut.
    blueprint = given.blueprint()
    assert blueprint.node_names == tuple("bacdefg")
    assert blueprint.body_of_node == ("b a c",) * 3 + ("d e",) * 2 + ("bar",) * 2
    assert blueprint.node_radius == pytest.approx([8e-3, 8e-3, 0.0, 8e-3, 8e-3, 5e-3, 5e-3])
    # Cables are named by group and nodes; a tension gives the free length.
    assert blueprint.cable_names == ("side b d", "side c d", "long e f")
    assert blueprint.cable_keys[1] == "cables.side.pairs[1]"
    assert (blueprint.oscillators, blueprint.groups) == (("left", "right"), ((0, 2), (1,)))
    length = np.hypot(0.07, 0.10)
    free_lengths = [law.free_length for law in blueprint.cable_laws]
    assert free_lengths == pytest.approx([0.02, 0.02, length - 2 / 100])
    assert [blueprint.node_names[node] for node in blueprint.contacts] == ["a", "g"]
    assert structure_of("small", "contacts: all").blueprint().contacts.tolist() == list(range(7))


def test_a_node_that_nothing_uses_is_left_out_with_a_note(tmp_path, caplog) -> None:
    file = tmp_path / "my.yaml"
    file.write_text(SMALL.replace("nodes:", "nodes:\n  spare: [1, 1, 1]", 1))
    assert read_structure(file).blueprint().node_names == tuple("bacdefg")
    assert "spare" in caplog.text
