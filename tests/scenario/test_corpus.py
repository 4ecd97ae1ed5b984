"""Structures of the literature: every file is a structure, and what is known of some comes out."""

import functools
import json
import math

import corpus
import numpy as np
import pytest

from tetra_drake.scenario.structure_files import read_structure
from tetra_drake.scenario.yaml_text import parse_yaml
from tetra_drake.study.equilibrium import EquilibriumStudy, study_equilibrium

ROWS = json.loads(corpus.MEASURED.read_text(encoding="utf-8"))


@functools.cache
def study(name: str) -> EquilibriumStudy:
    return study_equilibrium(corpus.robot_of(name))


def test_every_file_is_a_structure_with_a_source() -> None:
    for name in corpus.names():
        file = corpus.FOLDER / f"{name}.yaml"
        assert "\n# source: " in file.read_text(encoding="utf-8"), name
        assert read_structure(file).blueprint().bodies, name
    known = parse_yaml(corpus.KNOWN.read_text(encoding="utf-8"), corpus.KNOWN)
    assert set(known) <= set(corpus.names())


def test_the_page_has_every_structure_as_measured() -> None:
    assert set(ROWS) == set(corpus.names())
    assert corpus.PAGE.read_text(encoding="utf-8") == corpus.page(ROWS)


@pytest.mark.parametrize("name", ROWS)
def test_a_structure_rests_on_every_engine_and_has_its_known_numbers(name: str) -> None:
    row = ROWS[name]
    assert max(row[engine] for engine in corpus.ENGINES) < 1e-5
    for what, known, ours, _ in row["known"]:
        assert ours == pytest.approx(known, rel=1e-3), what  # some sources give three digits


@pytest.mark.parametrize("count", [3, 4, 5, 6, 8])
def test_a_prism_turns_by_90_degrees_less_half_a_sector(count: int) -> None:
    # At a node the side cable and the bar have equal and opposite force densities, or the vertical
    # forces were not in balance. Their horizontal parts add up to q s, with s from the node of the
    # bar to the node of the cable, at the other end: a side of the polygon, 2 r sin(pi/n) long.
    # It has to be radial, as the two horizontal cables, q_h r (2 sin(pi/n))^2. So the middle of
    # that side is a right angle away from the node, and q_h / q = 1 / (2 sin(pi/n)).
    prism = study(f"prism_{count}")
    assert corpus.quantity(prism, "twist b0 t0") == pytest.approx(90.0 - 180.0 / count, abs=1e-5)
    side = 2.0 * math.sin(math.pi / count)
    lengths = corpus.quantity(prism, "length horizontal/side")
    ratio = corpus.quantity(prism, "tension horizontal/side")
    assert ratio == pytest.approx(lengths / side, rel=1e-6)


def test_six_bars_come_to_rest_half_a_bar_apart() -> None:
    # Bars of length 2 a along the axes, 2 b apart: a cable spans (a, b, a - b), so its length has
    # the square a^2 + b^2 + (a - b)^2, which is least at b = a / 2. It is then 3/8 of (2 a)^2.
    # The file has the bars 1.5 m apart, as NTRT does, which is more.
    ball = study("superball")
    assert corpus.quantity(ball, "distance z1b z2b/z1b z1t") == pytest.approx(0.5, abs=1e-6)
    lengths = ball.cables["length"] / corpus.quantity(ball, "distance z1b z1t")
    np.testing.assert_allclose(lengths, math.sqrt(3.0 / 8.0), rtol=1e-6)


def test_a_chain_hangs_as_its_weights_pull() -> None:
    # The horizontal force is the same in all links; the vertical one grows by a weight a node.
    chain = study("hanging_chain")
    p_WN = chain.nodes.loc[[f"n{i}" for i in range(12)], ["x", "z"]].to_numpy()
    along = np.diff(p_WN, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, np.newaxis]
    tensions = chain.cables.loc[[f"link n{i} n{i + 1}" for i in range(11)], "tension"].to_numpy()
    force = tensions[:, np.newaxis] * along
    weight = chain.robot.weight / 10.0
    np.testing.assert_allclose(force[:, 0], force[0, 0], rtol=1e-7)
    np.testing.assert_allclose(np.diff(force[:, 1]), weight, rtol=1e-6)


def test_a_weight_on_a_ring_hangs_and_swings_as_on_an_ellipse() -> None:
    # Its rope has a fixed length 2 a, so it moves on an ellipse whose foci are the supports, 2 c
    # apart. At the lowest point, b below them, the ellipse has the curvature b / a^2.
    pulley = study("pulley")
    a, b = math.sqrt(2.0), 1.0
    weight, g = pulley.robot.weight, pulley.robot.scenario.robot.gravity
    tension = corpus.quantity(pulley, "tension rope")
    assert tension == pytest.approx(0.5 * weight * a / b, rel=1e-6)
    frequency = math.sqrt(g * b) / a / (2.0 * math.pi)
    assert corpus.quantity(pulley, "frequency") == pytest.approx(frequency, rel=1e-5)


def test_cables_across_a_rhombus_of_pinned_bars_pull_as_they_are_long() -> None:
    # A bar from (x, 0) to (0, y) bears a force along it, so half the cables' pulls are as x and y.
    rhombus = study("d_bar")
    tensions, lengths = (corpus.quantity(rhombus, f"{k} long/cross") for k in ("tension", "length"))
    assert tensions == pytest.approx(lengths, rel=1e-5)
