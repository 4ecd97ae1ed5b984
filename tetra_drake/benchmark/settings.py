"""Settings of the engines to compare: each is a dict of changes for Scenario.with_changes."""

from __future__ import annotations

import itertools
from typing import Any

from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.schema import Scenario

Changes = dict[str, Any]

SETS = ("default", "integrators", "compiled", "mujoco")
"""The names of sets of settings."""


def grounds() -> dict[str, Changes]:
    """Grounds to compare the speed on: the scenario's, and with what the shipped scenario `rough`
    has other than the thesis. On the first, a network that is computed beforehand and a live one.
    """
    shipped = load_scenario("rough")
    rough = {"terrain": shipped.terrain, "robot.contacts": shipped.robot.contacts}
    coulomb = {
        "friction": shipped.friction,
        "compiled.tolerance": f"{shipped.compiled.tolerance!r} m/s",
    }
    return {
        "the scenario's": {},
        "the scenario's, signals computed beforehand": {
            "cpg.signals": "recorded",
            "cpg.feedback": [],
        },
        "the scenario's, live network": {"cpg.signals": "live"},
        "with Coulomb friction": coulomb,
        "rough": rough,
        "rough, with Coulomb friction": rough | coulomb,
    }


def settings_of(name: str) -> list[Changes]:
    """The settings of one of SETS, the scenario's own first."""
    if name == "compiled":
        axes = (1.0, 0.3, 0.1, 0.03), (2, 3, 4), (0.05, 0.02, 0.005)
        return [own("compiled"), *itertools.starmap(compiled, itertools.product(*axes))]
    if name == "integrators":
        return [own("drake"), *_drake_settings()]
    if name == "mujoco":
        steps = {
            "Euler": (1, 0.5, 0.25, 0.125),  # MuJoCo's default
            "implicitfast": (4, 2, 1, 0.5, 0.25, 0.125),  # which MuJoCo recommends
            "discrete": (20, 10, 5, 2, 1),  # which it advises for stiff springs, strong damping
        }
        return [own("mujoco")] + [mujoco(scheme, ms) for scheme in steps for ms in steps[scheme]]
    others = [mujoco("implicitfast", 2), mujoco("Euler", 0.25), mujoco("discrete", 1)]
    return [own("drake"), drake("runge_kutta3", 1e-3, 2), own("compiled"), own("mujoco"), *others]


def own(engine: str) -> Changes:
    """An engine with the scenario's own settings."""
    return {"simulation.engine": engine}


def drake(
    scheme: str, accuracy: float, max_step: float, look_ahead: float = 0.0, witness: float = 0.0
) -> Changes:
    """The Drake diagram, times in ms. Mode changes are at step ends, or located by a witness
    function to within the time `witness`."""
    changes = own("drake") | {
        "simulation.scheme": scheme,
        "simulation.accuracy": accuracy,
        "simulation.max_step": f"{max_step} ms",
        "simulation.look_ahead": f"{look_ahead} ms",
        "simulation.mode_changes": "witness" if witness else "step_end",
    }
    return changes | ({"simulation.witness_window": f"{witness} ms"} if witness else {})


def compiled(tolerance: float, max_step: float, look_ahead: float) -> Changes:
    """The compiled engine, its tolerance in mm/s, times in ms."""
    return own("compiled") | {
        "compiled.tolerance": f"{tolerance} mm/s",
        "compiled.max_step": f"{max_step} ms",
        "compiled.look_ahead": f"{look_ahead} ms",
    }


def mujoco(integrator: str, step: float) -> Changes:
    """MuJoCo, the step in ms."""
    return own("mujoco") | {"mujoco.integrator": integrator, "mujoco.step": f"{step} ms"}


def describe(scenario: Scenario) -> str:
    """How a scenario is simulated on its engine, such as "implicitfast, steps of 0.125 ms"."""
    simulation = scenario.simulation
    if simulation.engine == "mujoco":
        return f"{scenario.mujoco.integrator}, steps of {_ms(scenario.mujoco.step)}"
    if simulation.engine == "compiled":
        own = scenario.compiled
        error = f"ros2 at {1e3 * own.tolerance:g} mm/s"
        return f"{error}, steps up to {_ms(own.max_step)}, look-ahead {_ms(own.look_ahead)}"
    placement = "step end"
    if simulation.mode_changes == "witness":
        placement = f"witness {_ms(simulation.witness_window)}"
    elif simulation.look_ahead > 0.0:
        placement = f"look-ahead {_ms(simulation.look_ahead)}"
    steps = f"steps up to {_ms(simulation.max_step)}"
    return f"{simulation.scheme} at {simulation.accuracy:g}, {steps}, {placement}"


def _drake_settings() -> list[Changes]:
    step_end, look_ahead, witness = (0.0, 0.0), (0.02, 0.0), (0.0, 0.02)
    explicit = itertools.product((1e-2, 1e-3, 1e-4), (step_end, witness))
    implicit = itertools.product((2, 4, 8), (5e-3, 1e-3), (step_end, look_ahead, witness))
    first_order = ("implicit_euler", "velocity_implicit_euler", "radau1")
    return [
        *(drake("runge_kutta3", accuracy, 2, *place) for accuracy, place in explicit),
        *(drake("radau3", accuracy, step, *place) for step, accuracy, place in implicit),
        *(drake(scheme, 1e-2, 2) for scheme in first_order),
        *(drake("semi_explicit_euler", 1e-3, 0.1), drake("runge_kutta3", 1e-5, 0.05)),
    ]


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:g} ms"
