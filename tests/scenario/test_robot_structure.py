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
    free_lengths = [law["free_length"] for law in blueprint.cable_laws]
    assert free_lengths == pytest.approx([0.02, 0.02, length - 2 / 100])
    assert [blueprint.node_names[node] for node in blueprint.contacts] == ["a", "g"]
    assert structure_of("small", "contacts: all").blueprint().contacts.tolist() == list(range(7))


def test_a_node_of_no_strut_that_the_world_holds_is_fixed() -> None:
    given = structure_of(
        "small",
        "{nodes: {h: [1, 1, 9]}, anchors: {h: xyz, a: xz}, loads: {g: [0 N, 0 N, -6 N]}, "
        "contacts: all, cables: {up: {pairs: [[a, h]], stiffness: 1 N/m, damping: 0 N*s/m, "
        "free_length: 0 m}}}",
    )
    blueprint = given.blueprint()
    assert blueprint.node_names[-1] == "h"
    assert blueprint.body_of_node[-1] == "world"
    assert blueprint.held[-1].all()
    assert blueprint.p_WN[-1] == pytest.approx([0.01, 0.01, 0.09])
    assert blueprint.cable_names[0] == "up a h"
    assert blueprint.contacts.tolist() == list(range(7)), "all but h"
    a, g = blueprint.node_names.index("a"), blueprint.node_names.index("g")
    assert blueprint.held[a].tolist() == [True, False, True]
    assert blueprint.anchor_damping[a] == pytest.approx(1e-3 * blueprint.anchor_stiffness[a])
    assert blueprint.node_load[g].tolist() == [0.0, 0.0, -6.0]
    assert np.count_nonzero(blueprint.node_load) == 1


<<<<<<< HEAD
def test_springs_and_dampers_of_nodes_add_to_anchors() -> None:
    given = structure_of(
        "small",
        "{anchors: {a: x}, anchor_stiffness: 1e5 N/m, springs: {a: 2 N/m}, dampers: {g: 4 N*s/m}}",
    )
    blueprint = given.blueprint()
    a, g = blueprint.node_names.index("a"), blueprint.node_names.index("g")
    assert blueprint.anchor_stiffness[[a, g]].tolist() == [[1e5 + 2, 2, 2], [0, 0, 0]]
    assert blueprint.anchor_damping[[a, g]].tolist() == [[100, 0, 0], [4, 4, 4]]
    assert np.count_nonzero(blueprint.anchor_stiffness) == 3
    every = ", ".join(f"{node}: 1 N/m" for node in "abcdefg")  # which can move nevertheless
    assert structure_of("small", f"springs: {{{every}}}").blueprint().held.all()


=======
>>>>>>> eb319aa631eee29f2e2e6e5426aafbcf3303ba0d
def test_a_node_that_nothing_uses_is_left_out_with_a_note(tmp_path, caplog) -> None:
    file = tmp_path / "my.yaml"
    file.write_text(SMALL.replace("nodes:", "nodes:\n  spare: [1, 1, 1]", 1))
    assert read_structure(file).blueprint().node_names == tuple("bacdefg")
    assert "spare" in caplog.text


def test_cables_of_two_groups_may_join_the_same_nodes() -> None:
    given = structure_of(
        "small", "cables: {long: {pairs: [[e, f], [d, b]]}}\nactuated: {left: [long b d]}"
    )
    blueprint = given.blueprint()
    assert blueprint.cable_names[:3] == ("side b d", "side c d", "long d b")
    assert blueprint.groups[0] == (2,)
<<<<<<< HEAD
=======


TWO_FIXED = "nodes: {h: [1, 1, 1], i: [1, 1, 2]}\nanchors: {h: xyz, i: xyz}\n"


@pytest.mark.parametrize(
    ("changes", "key", "facts"),
    [
        ("cables: {side: {pairs: [[b, dd]]}}", "cables.side.pairs[0]", ["'dd'", "mean 'd'"]),
        ("cables: {long: {pairs: [[e, f], [f, e]]}}", "cables.long.pairs[1]", ["long.pairs[0]"]),
        ("cables: {side: {pairs: [[b, d], [b, c]]}}", "cables.side.pairs[1]", ["'b a c'"]),
        ("cables: {long: {pairs: [[c, e]]}}", "cables", ["'bar'", "'b a c'"]),
        ("cables: {long: {tension: 12.3 N}}", "cables.long.tension", ["12.3 N", "12.21 N"]),
        ("cables: {long: {free_length: 1 m}}", "cables.long.free_length", ["both"]),
        ("cables: {a b: {pairs: []}}", "cables.a b", ["blanks"]),
        ("nodes: {d: [9, 2, 5]}", "nodes.f", ["'d'", "0.0001 m"]),
        ("nodes: {e: [2, 2, 5]}", "struts.arm.pairs[1]", ["length 0"]),
        ("nodes: {7: [2, 2, 1]}", "nodes.7", ["n7"]),
        ("nodes: {g: [9, 2, -20 km]}", "nodes.g", ["-20000.0", "10000 m"]),
        ("nodes: {g: [9, 2, 9 km], f: [9, 2, -9 km]}", "struts.bar.pairs[0]", ["10000 m"]),
        ("struts: {bar: {diameter: 0.04 um}}", "struts.bar.pairs[0]", ["1e-05"]),
        ("struts: {bar: {density: 1e-12 g/m^3}}", "struts.bar.pairs[0]", ["1e-12 kg"]),
        ("contacts: []", "contacts", ["one node"]),
        ("unit: kg", "unit", ["'kg'"]),
        ("actuated: {left: [side b e]}", "actuated.left[0]", ["'side b e'", "mean 'side b d'"]),
        ("actuated: {right: [side c d, side b d]}", "actuated.right[1]", ["'left'"]),
        ("struts: {leg: {axial_stiffness: 1 N/m}}", "struts.leg.axial_stiffness", ["a c", "rigid"]),
        ("{nodes: {h: [1, 1, 1]}, anchors: {h: xz}}", "nodes.h", ["no strut", "xyz"]),
        ("{nodes: {h: [1, 1, 1]}, loads: {h: [0 N, 0 N, 1 N]}}", "loads.h", ["unused"]),
        ("{nodes: {h: [1, 1, 1]}, masses: {h: 1 g}}", "nodes.h", ["no cable"]),
        ("struts: {bar: {density: 0}}", "nodes.f", ["0 kg"]),
        ("anchors: {a: xyz, b: yz, c: z, d: xyz, e: xy, f: xyz, g: xy}", "anchors", ["every body"]),
        (f"{TWO_FIXED}cables: {{long: {{pairs: [[h, i]]}}}}", "cables.long.pairs[0]", ["fixed"]),
    ],
)
def test_problems_name_key_and_facts(changes: str, key: str, facts: list[str], refused) -> None:
    with refused("my.yaml", key, *facts):
        structure(changes)


BOMB = "- &b0 [1]\n" + "\n".join(f"- &b{i} [{f'*b{i - 1}, ' * 9}]" for i in range(1, 13))


def test_aliases_that_stand_for_a_list_without_end_are_refused_at_once(refused) -> None:
    """By YAML's aliases a short text is a list of 9^12 numbers."""
    with refused("my.yaml", "", "aliases"):
        parse_yaml(BOMB, "my.yaml")


def test_nodes_with_units_need_no_unit_and_bare_ones_do(tmp_path: Path, refused) -> None:
    file = tmp_path / "my.yaml"
    file.write_text(FILE.replace("unit: cm", ""))
    with refused(file, "nodes.g[0]"):
        read_structure(file)
>>>>>>> eb319aa631eee29f2e2e6e5426aafbcf3303ba0d
