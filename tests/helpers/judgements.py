"""Robustness of two made-up gaits."""

from pathlib import Path

import pandas
import yaml

from helpers.synthetic_run import tiny_scenario
from tetra_drake.lab.study.robustness import Judgement
from tetra_drake.scenario.experiment_sections import Disturbances


def judgement_by_hand() -> Judgement:
    """A judgement made by hand, of factors p and q; distances in m."""
    tables = yaml.safe_load(Path(__file__).with_name("judgement.yaml").read_text("utf-8"))
    spread = Disturbances(draws=1, spreads={"p": 0.2, "q": 0.5})
    judged = tiny_scenario().with_sections(disturbances=spread)
    return Judgement(judged, seed=0, **{k: pandas.DataFrame(v) for k, v in tables.items()})
