"""What integrator settings cost and how exact they are: a work-precision table."""

from __future__ import annotations

import dataclasses
import math
import multiprocessing
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np

from tetra_drake.engines.simulate import simulate
from tetra_drake.errors import SimulationFailure
from tetra_drake.robot.gait import Gait
from tetra_drake.scenario.schema import CompiledScenario, Scenario

STEP_END, LOOK_AHEAD, WITNESS = "step end", "look-ahead", "witness"


@dataclass(frozen=True)
class Setting:
    """One row of the table: how to integrate. Steps and windows in ms."""

    scheme: str
    accuracy: float
    max_step_ms: float
    mode_changes: str
    """STEP_END, LOOK_AHEAD (step ends aimed at predicted mode changes) or WITNESS."""
    resolution_ms: float = 0.0
    """Shortest aimed step, or the witness's window."""

    def apply(self, scenario: Scenario) -> Scenario:
        """The scenario with this setting's integrator."""
        simulation = dataclasses.replace(
            scenario.simulation,
            scheme=self.scheme,
            accuracy=self.accuracy,
            max_step=1e-3 * self.max_step_ms,
            mode_changes="witness" if self.mode_changes == WITNESS else "step_end",
            look_ahead=1e-3 * self.resolution_ms if self.mode_changes == LOOK_AHEAD else 0.0,
        )
        if self.mode_changes == WITNESS:
            simulation.witness_window = 1e-3 * self.resolution_ms
        return dataclasses.replace(scenario, simulation=simulation)

    @property
    def cells(self) -> list[str]:
        """What the table says of the setting."""
        placement = self.mode_changes
        if self.resolution_ms:
            placement += f" {self.resolution_ms:g} ms"
        return [self.scheme, f"{self.accuracy:g}", f"{self.max_step_ms:g} ms", placement]


@dataclass(frozen=True)
class CompiledSetting:
    """One row of the compiled engine's table. Tolerances in mm/s, times in ms."""

    tolerance_mm_s: float
    max_step_ms: float
    look_ahead_ms: float

    def apply(self, scenario: Scenario) -> Scenario:
        """The scenario with this setting of the compiled engine."""
        compiled = CompiledScenario(
            tolerance=1e-3 * self.tolerance_mm_s,
            max_step=1e-3 * self.max_step_ms,
            look_ahead=1e-3 * self.look_ahead_ms,
        )
        return dataclasses.replace(scenario, compiled=compiled)

    @property
    def cells(self) -> list[str]:
        """What the table says of the setting."""
        placement = f"{LOOK_AHEAD} {self.look_ahead_ms:g} ms"
        return ["ros2", f"{self.tolerance_mm_s:g} mm/s", f"{self.max_step_ms:g} ms", placement]


AnySetting = Setting | CompiledSetting

CONVERGED = Setting("runge_kutta3", 1e-5, 0.05, STEP_END)
"""Steps well inside the explicit stability limit, short against every stiction phase."""

CONVERGED_COMPILED = CompiledSetting(1e-3, 0.5, 1e-3)


@dataclass(frozen=True)
class Run:
    """One gait with one setting; NaN distance where the simulation failed."""

    distance_in: float
    wall_time: float
    steps: int
    derivative_evaluations: int
    jacobian_evaluations: int


@dataclass(frozen=True)
class Row:
    """A setting's runs, and their distance errors (in) against the converged runs, by gait."""

    setting: AnySetting
    runs: tuple[Run, ...]
    errors_in: np.ndarray


def default_setting(scenario: Scenario) -> AnySetting:
    """What the scenario itself asks for."""
    if scenario.simulation.engine == "compiled":
        compiled = scenario.compiled
        return CompiledSetting(
            1e3 * compiled.tolerance, 1e3 * compiled.max_step, 1e3 * compiled.look_ahead
        )
    simulation = scenario.simulation
    placement, resolution = STEP_END, 0.0
    if simulation.mode_changes == "witness":
        placement, resolution = WITNESS, simulation.witness_window
    elif simulation.look_ahead > 0.0:
        placement, resolution = LOOK_AHEAD, simulation.look_ahead
    return Setting(
        simulation.scheme,
        simulation.accuracy,
        1e3 * simulation.max_step,
        placement,
        1e3 * resolution,
    )


def settings_to_compare() -> list[Setting]:
    """Schemes x accuracies x largest steps x placements of mode changes."""
    placements = ((STEP_END, 0.0), (LOOK_AHEAD, 0.25), (WITNESS, 0.02))
    explicit = [
        Setting("runge_kutta3", accuracy, 2.0, placement, resolution)
        for accuracy in (1e-2, 1e-3, 1e-4)
        for placement, resolution in ((STEP_END, 0.0), (WITNESS, 0.02))
    ]
    implicit = [
        Setting("radau3", accuracy, max_step, *placement)
        for max_step in (2.0, 4.0, 8.0)
        for accuracy in (5e-3, 1e-3)
        for placement in placements
    ]
    others = [
        Setting("implicit_euler", 1e-2, 2.0, STEP_END),
        Setting("velocity_implicit_euler", 1e-2, 2.0, STEP_END),
        Setting("radau1", 1e-2, 2.0, STEP_END),
        Setting("semi_explicit_euler", 1e-3, 0.1, STEP_END),
    ]
    return explicit + implicit + others


def compiled_settings_to_compare() -> list[CompiledSetting]:
    """Tolerances x largest steps x ends beyond predicted mode changes."""
    return [
        CompiledSetting(tolerance, max_step, look_ahead)
        for tolerance in (1.0, 0.3, 0.1, 0.03)
        for max_step in (2.0, 3.0, 4.0)
        for look_ahead in (0.05, 0.02, 0.005)
    ]


def run_setting(scenario: Scenario, gait: Gait, setting: AnySetting) -> Run:
    """Simulates one gait with one setting."""
    try:
        result = simulate(scenario=setting.apply(scenario), gait=gait)
    except SimulationFailure:
        return Run(math.nan, math.nan, 0, 0, 0)
    return Run(
        distance_in=result.metrics.distance_in,
        wall_time=result.wall_time,
        steps=result.integrator.steps,
        derivative_evaluations=result.integrator.derivative_evaluations,
        jacobian_evaluations=result.integrator.jacobian_evaluations,
    )


def measure(scenario: Scenario, gaits: Sequence[Gait], *, workers: int = 1) -> Iterable[Row]:
    """Runs every gait with every setting, the converged and the default one first.

    Yields row after row. Wall times mean something with one worker on an idle machine.
    """
    default = default_setting(scenario)
    converged: AnySetting = CONVERGED
    candidates: Sequence[AnySetting] = settings_to_compare()
    if scenario.simulation.engine == "compiled":
        converged, candidates = CONVERGED_COMPILED, compiled_settings_to_compare()
    rest = [setting for setting in candidates if setting.cells != default.cells]
    exact = None
    for setting in (converged, default, *rest):
        runs = run_gaits(scenario, gaits, setting, workers=workers)
        distances = np.array([run.distance_in for run in runs])
        exact = distances if exact is None else exact
        yield Row(setting, runs, distances - exact)


def run_gaits(
    scenario: Scenario, gaits: Sequence[Gait], setting: AnySetting, *, workers: int
) -> tuple[Run, ...]:
    """Simulates the gaits with one setting, in fresh processes: some Drakes leak diagrams."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(
        workers, mp_context=context, initializer=_warm_up, initargs=(scenario, gaits[0])
    ) as executor:
        count = len(gaits)
        return tuple(executor.map(run_setting, [scenario] * count, gaits, [setting] * count))


def _warm_up(scenario: Scenario, gait: Gait) -> None:
    """Loads or compiles the kernels, which belongs to no run's wall time."""
    instant = scenario.with_changes({"simulation.duration": 0.02, "simulation.steady_from": 0.01})
    run_setting(instant, gait, default_setting(scenario))


def format_row(row: Row, duration: float) -> str:
    """One line of the table, in Markdown."""
    errors = np.abs(row.errors_in)
    runs = [run for run in row.runs if math.isfinite(run.wall_time)]
    failed = len(row.runs) - len(runs)
    cells = row.setting.cells
    if not runs:
        return "| " + " | ".join([*cells, "failed", "", "", "", "", ""]) + " |"
    wall = float(np.mean([run.wall_time for run in runs]))
    cells += [
        f"{np.nanmedian(errors):.3f}",
        f"{np.nanmax(errors):.3f}" + (f" ({failed} failed)" if failed else ""),
        f"{np.mean([run.derivative_evaluations for run in runs]) / 1e3:.0f}k",
        f"{np.mean([run.jacobian_evaluations for run in runs]) / 1e3:.0f}k",
        f"{wall:.2g} s",
        f"{duration / wall:.3g}",
    ]
    return "| " + " | ".join(cells) + " |"


HEADER = (
    "| scheme | accuracy | max step | mode changes | median error, in | worst error, in | "
    "evaluations | of them Jacobian | wall time | times real time |\n"
    "|---|---|---|---|---|---|---|---|---|---|"
)
