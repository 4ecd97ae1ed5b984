"""A published model in MuJoCo and converted: its page, and what its numbers say."""

import numpy as np
import published

from tetra_drake.files import read_json

NUMBERS = read_json(published.OUT / "numbers.json", "numbers")


def test_engines_are_nearer_to_each_other_than_to_mujoco_and_springs_that_push_differ_most():
    for motions in NUMBERS.values():
        apart = {name: np.array(each["apart_mm"]) for name, each in motions.items()}
        engines = np.abs(apart["compiled"] - apart["drake"])
        assert (engines < 0.1 * apart["compiled"]).all()
        assert np.median(apart["MuJoCo"]) > 2.0 * np.median(apart["compiled"])
