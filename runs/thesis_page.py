"""The thesis, number by number: the page thesis/THESIS.md, and the thesis's figures drawn again.

    python runs/thesis_page.py

Numbers are from the recorded runs and from short simulations. The text of the page is the template
templates/thesis.md.jinja.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import readings
import xarray
from analyse import load_analysis
from claims import MOTION, claims
from page import over, rendered
from record import load_times
from script import read_record, script
from settle import difference_of_means
from sine import TRIED, load_sines, steady_signals, steady_times
from tables import aspect, best_gait
from thesis_figures import save_figures

from tetra_drake.engines.simulate import simulate
from tetra_drake.evolution.run import Run, load_run
from tetra_drake.files import read_json, write_whole
from tetra_drake.formatting import fixed, ranged, rounded
from tetra_drake.lab.study.sweep import sweep
from tetra_drake.robot.measures import dominant_frequency
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import load_scenario
from tetra_drake.settings.section import flattened, written
from tetra_drake.settings.units import INCH, POUND_FORCE, plainest

HERE = Path(__file__).parent
PAGE, FIGURES = HERE / "thesis/THESIS.md", HERE / "thesis/redrawn"
NUMBERS = HERE / "thesis/simulated.json"
FORMER = HERE / "thesis-reversal"

sys.path.append(str(HERE.parent / "diagrams"))

import settling_node  # noqa: E402
import single_oscillator  # noqa: E402
import sliding_tetrahedron  # noqa: E402

ROW = 810
"""Width of two pictures beside each other, in pixels."""
FINE = "!Compiled {tolerance: 1e-5 m/s, max_step: 1 ms}"
DRAWS = 2000
"""Number of sets of random weights beside which the evolved weights are judged."""


def setting(label: str, given: Any, key: str) -> str:
    """Item of a list of settings: the thesis's value, and our key; our value if it differs."""
    scenario = load_scenario("thesis")
    ours = flattened(written(scenario.model_dump(), plainest))[key]
    same = scenario.with_changes({key: given}).values()[key] == scenario.values()[key]
    return f"- {label}: {given}, `{key}`{'' if same else f', **not** {ours}'}"


def over_trials(values: pandas.Series, digits: int = 2) -> str:
    """Mean and range of numbers of the trials."""
    return over([values.mean(), values.min(), values.max()], digits)


def two_best(run: Run) -> pandas.DataFrame:
    """Absolute differences of fitness and parameters of the two best gaits of each trial, as in
    Table 8; they are in its last population. Gaits with the same parameters count once."""
    best = run.best(2).set_index("trial").filter(regex="^(fitness$|weight |tau_)")
    return best.groupby("trial").diff().dropna().abs()


def weights_pattern(run: Run) -> dict[str, str]:
    """Test for a pattern in the weights of the trials' best gaits.

    A weight's spread over the trials is compared with the spread of random weights in the bounds of
    Table 5. Shuffled weights of each gait tell how much the weights' means differ by chance.
    """
    gait_bounds, generator = run.scenario.gait_bounds, np.random.default_rng(0)
    weights = run.best().filter(like="weight ")
    low, high = gait_bounds.weight_min, gait_bounds.weight_max
    random = generator.uniform(low, high, (DRAWS, *weights.shape)).std(axis=1, ddof=1)
    means, table = weights.mean(), weights.to_numpy()
    shuffled = [generator.permuted(table, axis=1).mean(axis=0).std() for _ in range(DRAWS)]
    as_far = int((np.array(shuffled) >= means.std(ddof=0)).sum())
    return {
        "spread": over_trials(weights.std()),
        "random_spread": fixed(random.mean()),
        "means": f"{fixed(means.std(ddof=0))}, by chance {fixed(np.mean(shuffled))}",
        "p": f"{'<' if as_far == 0 else '='} {max(as_far, 1) / DRAWS:g}",
    }


def trials_numbers(run: Run) -> dict[str, Any]:
    """Numbers of the thesis's chapter 3 from a run; readings.py has the rest."""
    best, scenario = run.best().set_index("trial"), run.scenario
    trial, robot = int(best["fitness"].idxmax()), Robot.of(scenario)
    iterations = run.iterations.groupby("trial")["iteration"].max()
    wall_time = load_times(HERE)[run.directory.name]["wall_s"]
    seconds = wall_time / iterations.sum()
    signals = [steady_signals(robot, gait)[:, 0] for gait in run.gaits()]
    times = steady_times(scenario)
    hertz = pandas.Series([dominant_frequency(times, signal) for signal in signals])
    return {
        "trial": trial,
        "initial": run.initial(),
        "best": best,
        "pairs": two_best(run),
        "levelled": sum("levelled" in str(status.stop) for status in run.statuses),
        "seconds": rounded(seconds, 2),
        "faster": f"{round(2.0 * scenario.simulation.duration / seconds, -2):,.0f}",
        "trial_seconds": seconds * iterations,
        "hertz": hertz,
        "swing": fixed(np.ptp(signals[trial]) / POUND_FORCE),
        **weights_pattern(run),
    }


def ground_numbers() -> dict[str, str]:
    """Numbers of section 2.1 and of a single oscillator, from short simulations."""
    scenario, thesis = load_scenario("thesis"), settling_node.THESIS_RESTITUTION
    settling, bouncing = settling_node.settle(scenario), settling_node.bounce(scenario)
    speed, rebound = settling_node.contact_speeds(bouncing)
    alpha = settling_node.velocity_correction(scenario)
    leading, thrown = sliding_tetrahedron.LEADING, sliding_tetrahedron.slide(scenario)
    slipping = sliding_tetrahedron.slide(load_scenario("thesis-reversal"))
    slips = sliding_tetrahedron.slips(slipping, leading)
    ways = [sliding_tetrahedron.travel(motion, leading)[-1] for motion in (thrown, slipping)]
    hertz, robot = single_oscillator.linear_frequency(scenario), Robot.of(scenario)
    needed = single_oscillator.TAU_A * hertz / single_oscillator.THESIS_FREQUENCY
    return {
        "impact": fixed(settling_node.contact_speeds(settling)[0] / INCH, 3),
        "deep": fixed(-settling.p_WN[-1, settling_node.TRAILING, 2] / INCH, 4),
        "restitution": fixed(rebound / speed, 3),
        "linear": fixed(1.0 - alpha * speed, 3),
        "alpha": fixed(alpha * INCH),
        "aimed_alpha": fixed((1.0 - thesis) / (speed / INCH), 3),
        "rest": fixed(ways[0] / INCH, 3),
        "slid": fixed(ways[1] / INCH, 3),
        "slips": f"{1e3 * slips[0][0]:.1f} to {1e3 * slips[0][1]:.0f} ms",
        "hertz": fixed(hertz),
        "needed_tau": fixed(needed, 3),
        "weight": fixed(robot.weight / POUND_FORCE, 3),
        "mass": fixed(1e3 * robot.structure.mass[0], 1),
        "spacing": fixed(np.diff(robot.structure.p_WB[:2, 0])[0] / INCH),
        "contacts": str(len(robot.structure.contacts)),
    }


def motions(run: Run, engine: str) -> xarray.DataArray:
    """Places p_WN (m) of the nodes in the first 5 s, for the best gaits of a run on an engine."""
    scenario = run.scenario.with_changes({"simulation.duration": "5 s", "engine": engine})
    walks = [simulate(scenario, gait, record=True).trajectory for gait in run.gaits()]
    return xarray.concat([walk.p_WN for walk in walks], "gait")


def motion_errors(run: Run, engines: Iterable[str]) -> list[str]:
    """Greatest error (in) of a node's place on each engine beside a fine one, over the best gaits
    of a run."""
    exact, *others = (motions(run, engine) for engine in (FINE, *engines))
    apart = [abs(each - exact).max(["time", "node", "axis"]) / INCH for each in others]
    return [over_trials(each.to_series()) for each in apart]


def widths(*pictures: str) -> list[int]:
    """Widths (pixels) of pictures in a row, so that all have the same height."""
    shapes = [aspect(PAGE.parent / picture) for picture in pictures]
    return [round(ROW * shape / sum(shapes)) for shape in shapes]


def reached(name: str) -> str:
    """Distance of the best gait of a run."""
    return best_gait(name, load_analysis(HERE / name)).text("compiled", 1)


def apart(first: str, second: str) -> str:
    """Difference of the mean distances (in) of two runs, second minus first, and its interval."""
    distances = (load_analysis(HERE / name).disturbed["undisturbed"] for name in (first, second))
    return ranged(*difference_of_means(*(each.to_numpy() / INCH for each in distances)))


def without_slip(run: Run) -> str:
    """Distances of a run's best gaits if no node slips: the deflection is reset to 0 at the
    stiction range."""
    walks = sweep(run, run.gaits(), {"friction.reset": "range"})
    return over_trials(walks["distance"].to_series() / INCH)


def simulated_numbers(run: Run) -> dict[str, Any]:
    """The numbers of the page that need simulations, of the run with slipping nodes."""
    return {
        "ground": ground_numbers(),
        "without_slip": without_slip(run),
        "errors": motion_errors(run, [readings.COARSE, readings.FIXED]),
    }


def page(run: Run, simulated: Mapping[str, Any]) -> str:
    """Text of the page, with simulated_numbers()."""
    sines = load_sines()
    tables = readings.load_tables()
    return rendered(
        "thesis.md",
        ours=trials_numbers(run),
        listing=trials_numbers(load_run(HERE / "thesis-listing")),
        former=trials_numbers(load_run(FORMER)),
        tried=TRIED,
        lbf=POUND_FORCE,
        sine=lambda name: fixed(sines[name]["distance_in"]),
        setting=setting,
        reached=reached,
        apart=apart,
        widths=widths,
        number=fixed,
        over=over_trials,
        readings=readings,
        **simulated,
        trials=tables,
        read={name: readings.results(trials) for name, trials in tables.items()},
        claims=read_record(MOTION, claims, "claims.py").rstrip(),
    )


@script
def main(_: Sequence[str] = ()) -> None:
    """Writes the page and the figures."""
    run = load_run(HERE / "thesis")
    save_figures(run, FIGURES)
    write_whole(NUMBERS, json.dumps(simulated_numbers(load_run(FORMER)), indent=1) + "\n")
    write_whole(PAGE, page(run, read_json(NUMBERS, "numbers")))
