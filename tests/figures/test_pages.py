"""On a page of any width every figure is whole, and no text is on another."""

import dataclasses
import functools
import itertools

import numpy as np
import pytest
from helpers import prism
from helpers.drawn import result_of
from helpers.judgements import judgement_by_hand
from helpers.made_up_walk import make_row, make_walk
from helpers.synthetic_run import write_map, write_run
from matplotlib.figure import Figure
from matplotlib.text import Text

from tetra_drake.evolution.run import load_run
from tetra_drake.figures.fitness import fitness_of_trials, initial_distances, initial_fitness
from tetra_drake.figures.forces import ground_forces, signals_and_tensions
from tetra_drake.figures.gait_diagram import gait_diagram
from tetra_drake.figures.motion import (
    before_and_after,
    one_step,
    path_of_the_centre,
    relative_distances,
    time_lapse,
)
from tetra_drake.figures.style import common_style
from tetra_drake.lab.comparison import compare, comparison
from tetra_drake.lab.elites.elites import map_of_gaits
from tetra_drake.lab.study.robustness import robustness_figure

OF_A_GAIT = [gait_diagram, relative_distances, time_lapse, path_of_the_centre, one_step]
OF_A_GAIT += [signals_and_tensions, ground_forces]
NAME = "$rough-feedback, seed 0, trial 5, evaluation 3991"


def with_long_names(robot):
    """A robot with names such as those of NTRT's structures."""
    long, names = "front_right/{0}/leg/knee base_bottom/{0}/saddle t1-bottom", {}
    for field in ("bodies", "node_names", "cable_names", "oscillators"):
        names[field] = tuple(map(long.format, getattr(robot.structure, field)))
    return dataclasses.replace(robot, structure=dataclasses.replace(robot.structure, **names))


@functools.cache
def gait_of(robot):
    """A result of a made-up motion, which no test may change."""
    if robot == "long names":
        carried = with_long_names(prism.make_prism())
        return result_of(carried, prism.slide_prism(carried), name=NAME * 4)
    bodies, duration = {"three": (3, 0.5), "five": (5, 9.0)}[robot]
    motion = make_walk(bodies=bodies, duration=duration)
    return result_of(make_row(bodies), motion, name=NAME)


@pytest.fixture
def drawn_texts(monkeypatch):
    """drawn_texts(figure): the places (texts, 4) of what is written, in pixels."""

    def drawn_texts(figure):
        places, draw = {}, Text.draw

        def record(text, renderer):
            draw(text, renderer)
            if text.get_visible() and text.get_text():
                places[text] = text.get_window_extent(renderer).extents

        with common_style(), monkeypatch.context() as patch:
            figure.get_layout_engine().execute(figure)  # it settles in the second, as if saved
            patch.setattr(Text, "draw", record)
            figure.draw_without_rendering()
        return np.array(list(places.values()))

    return drawn_texts


SLOW = pytest.mark.slow


WIDE, NARROW = 7.0, 3.4
"""Widths of a page (in)."""


@pytest.fixture(params=[NARROW, pytest.param(WIDE, marks=SLOW)], ids=repr)
def check(drawn_texts, request):
    """check(draw, *data): checks a figure on a page of its own of some width."""

    def check(draw, *data):
        figure = draw(*data, width_in=request.param)
        assert figure.get_figwidth() == request.param and figure.get_figheight() <= 10.0
        texts = drawn_texts(figure)
        assert texts[:, :2].min() >= 0.0 and (texts[:, 2:] <= figure.bbox.size).all()
        for a, b in itertools.combinations(texts, 2):
            assert (np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2])).min() <= 0.0

    return check


QUICK = ("five", NARROW), ("long names", WIDE)
ALL = itertools.product(("three", "five", "long names"), (WIDE, NARROW))


@pytest.mark.parametrize(
    ("robot", "check"),
    [pytest.param(*each, marks=() if each in QUICK else SLOW, id=f"{each}") for each in ALL],
    indirect=["check"],
)
@pytest.mark.parametrize("draw", OF_A_GAIT)
def test_figures_of_a_gait(draw, robot, check):
    check(draw, gait_of(robot))


@pytest.mark.parametrize("draw", OF_A_GAIT)
def test_a_time_that_was_not_simulated_is_refused(draw, refused):
    with refused("figure", "time", "20 to 30 s"):
        draw(gait_of("five"), time=(20.0, 30.0))


def test_figures_of_a_run(check, tmp_path):
    trials = [[[(3.0 * i, 0), (-1.0, 1)], [(4.0 * i, 1), (7.0, 0)]] for i in range(12)]
    run = load_run(write_run(tmp_path / "run", trials))
    check(fitness_of_trials, run)
    check(initial_distances, run)
    check(initial_fitness, run, 0)
    check(before_and_after, gait_of("three"), gait_of("five"))


def test_figures_of_analyses(check, tmp_path):
    runs = [write_run(tmp_path / name, [[[(1.0, 0)], [(2.0, 0)]]]) for name in ("a", "$b")]
    check(comparison, compare(runs, reach=0.01))
    check(map_of_gaits, load_run(write_map(tmp_path / "map", {0: 1.0, 1: 0.4})))
    check(robustness_figure, judgement_by_hand())


def test_one_body_has_no_distances_to_others(check):
    alone = gait_of("five").trajectory.isel(body=slice(0, 1))
    check(relative_distances, result_of(make_row(), alone))


def test_two_figures_are_side_by_side(drawn_texts):
    figure = Figure(figsize=(12.0, 6.0))
    left, right = figure.subfigures(1, 2)
    gait_diagram(gait_of("five"), figure=left)
    middle = figure.bbox.width / 2.0
    assert (drawn_texts(figure)[:, 2] <= middle).all()
    relative_distances(gait_of("five"), figure=right)
    texts = drawn_texts(figure)
    assert not ((texts[:, 0] < middle) & (texts[:, 2] > middle)).any()
