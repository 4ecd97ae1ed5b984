"""Robustness of two made-up gaits."""

import numpy as np
import pandas

from helpers.synthetic_run import tiny_scenario
from tetra_drake.lab.study.robustness import START, Judgement
from tetra_drake.scenario.experiment_sections import Disturbances


def judgement_by_hand() -> Judgement:
    """A judgement made by hand, of factors p and q; distances in m."""
    undisturbed = {"gait": ["a", "b"], "distance": [10.0, -10.0]}
    draws = {"gait": ["a", "b"] * 4, "draw": np.repeat(range(4), 2)}
    draws |= {"p": np.repeat([0.9, 1.0, 1.1, 1.2], 2), "q": np.repeat([1.2, 1.1, 1.0, 1.5], 2)}
    # Of a: 12, 9, 8.9 and a failure; of b: -11, -11.1, -9, 2.
    draws |= {"distance": [12.0, -11.0, 9.0, -11.1, 8.9, -9.0, np.nan, 2.0]}
    draws |= {"failure": [None] * 6 + ["fell", None], "missed": [""] * 7 + ["clearance"]}
    alone = {"gait": list("aabbab"), "what": ["p"] * 4 + [START] * 2, "missed": ""}
    alone |= {"distance": [9.0, 9.5, -10.25, np.nan, 4.0, -9.0]}
    alone |= {"failure": [None, None, None, "fell", None, None]}
    tables = {"undisturbed": undisturbed, "draws": draws, "alone": alone}
    spread = Disturbances(draws=1, spreads={"p": 0.2, "q": 0.5})
    judged = tiny_scenario().with_sections(disturbances=spread)
    return Judgement(judged, seed=0, **{k: pandas.DataFrame(v) for k, v in tables.items()})
