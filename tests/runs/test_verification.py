"""The page of problems whose motion is known: its numbers, and its errors."""

import json
from contextlib import nullcontext

import pytest
import verification

from tetra_drake.errors import SimulationFailure

RESULTS = json.loads((verification.HERE / verification.RESULTS).read_text("utf-8"))
LEAST = 1e-10
"""Errors below this are of rounding."""


def test_the_page_has_every_problem_with_its_engines_or_a_reason():
    page = (verification.HERE / "README.md").read_text("utf-8")
    assert {*RESULTS} == {*verification.PROBLEMS}
    for name, problem in verification.PROBLEMS.items():
        assert f"**{problem['title']}**" in page
        told = {*RESULTS[name]["engines"]} | {*problem.get("lacks", {})}
        assert told in ({"all"}, {*verification.ENGINES})


QUICK = ["bead", "tether", "projectile", "backspin", "hoop", "stopping"]
QUICK += ["stick_slip", "prism_modes"]


SLOW = {name: [] if name in QUICK else [pytest.mark.slow] for name in RESULTS}


@pytest.mark.parametrize(
    ("name", "engine"),
    [pytest.param(n, e, marks=SLOW[n]) for n in RESULTS for e in RESULTS[n]["engines"]],
)
def test_an_error_is_as_on_the_page(name, engine):
    """The error at the engine's defaults is at most three times what is written, or it fails."""
    known = RESULTS[name]["engines"][engine]
    if engine == "all":
        error = verification.verified(name)["engines"]["all"]["error"]
    else:
        fails = pytest.raises(SimulationFailure) if "failure" in known else nullcontext()
        with fails:
            default = verification.ENGINES[engine]["default"]
            error = verification.run(verification.PROBLEMS[name], default)["error"]
        if "failure" in known:
            return
    assert error <= max(3.0 * known["error"], LEAST), (name, engine)


def test_the_engines_have_the_orders_of_their_methods():
    orders = {name: numbers["order"] for name, numbers in RESULTS["brick"]["engines"].items()}
    assert orders == pytest.approx({"compiled": 2.0, "drake": 3.0, "mujoco": 1.0}, abs=0.15)
