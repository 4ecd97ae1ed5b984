"""What a measurement leaves behind: the tables a person reads, and a JSON file."""

from __future__ import annotations

import dataclasses
import math
import platform
from importlib import metadata
from pathlib import Path
from typing import Any

from tetra_drake.benchmark.errors import CLOSE_IN
from tetra_drake.benchmark.measure import CHECK, Measurement, Method
from tetra_drake.benchmark.mujoco_steps import REFERENCE
from tetra_drake.benchmark.work_precision import CONVERGED_COMPILED
from tetra_drake.engines.mujoco import FRICTION, INSTALL
from tetra_drake.evolution.executors import available_cores
from tetra_drake.experiment.markdown import fixed, markdown_table
from tetra_drake.results.result import versions

SCHEMA = 1


def summary(measurement: Measurement) -> str:
    """Both tables in Markdown, and what must be known to read them."""
    return "\n\n".join(
        [
            _introduction(measurement),
            _method_table(measurement),
            _notes(measurement),
            _step_table(measurement),
            "A step's cost is that of the loop, rejected steps in it; gaits are random.",
        ]
    )


def measurement_to_json(measurement: Measurement) -> dict[str, Any]:
    """The content of the file that --json writes. Lengths in inches, null for what failed."""
    scenario = measurement.scenario
    with_mujoco = measurement.mujoco_from_ours_in is not None
    return {
        "schema": SCHEMA,
        "scenario": scenario.name,
        "duration_s": scenario.simulation.duration,
        "versions": versions() | ({"mujoco": metadata.version("mujoco")} if with_mujoco else {}),
        "processor": {"name": processor_name(), "cores": available_cores()},
        "compile": {"time_s": measurement.compile_time, "from_cache": measurement.from_cache},
        "converged": {"setting": CONVERGED_COMPILED.cells, "check": CHECK.cells},
        "gaits": [
            {"name": gait.name, "well_conditioned": bool(counted)}
            for gait, counted in zip(measurement.gaits, measurement.counted, strict=True)
        ],
        "methods": [_method_to_json(method, measurement) for method in measurement.methods],
        "mujoco": {
            "friction": FRICTION,
            "reference": {"integrator": REFERENCE[0], "step_ms": REFERENCE[1]},
            "median_distance_from_ours_in": _or_null(measurement.mujoco_from_ours_in),
        }
        if measurement.mujoco_from_ours_in is not None
        else None,
        "step_costs": [
            dataclasses.asdict(cost) | {"microseconds": _or_null(cost.microseconds)}
            for cost in measurement.step_costs
        ],
    }


def processor_name() -> str:
    """What the machine calls its processor."""
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:  # no Linux
        pass
    return platform.processor() or platform.machine()


def _introduction(measurement: Measurement) -> str:
    scenario, gaits = measurement.scenario, measurement.gaits
    left_out = [
        gait.name for gait, counted in zip(gaits, measurement.counted, strict=True) if not counted
    ]
    cores = available_cores()
    lines = [
        f"{_count(len(gaits), 'gait')} of {scenario.simulation.duration:g} s on scenario "
        f"{scenario.name}; {processor_name()}, {_count(cores, 'core')}",
        f"ill-conditioned, not in the errors (two converged runs differ by more than {CLOSE_IN:g} "
        f"in): {len(left_out)}{' - ' if left_out else ''}{', '.join(left_out)}",
    ]
    took = f"{measurement.compile_time:.1f} s"
    if measurement.from_cache:
        lines.append(f"compiled engine: loaded from the cache in {took}")
    else:
        lines.append(f"compiled engine: compile time {took}, cached afterwards")
    return "\n".join(lines)


def _method_table(measurement: Measurement) -> str:
    headings = [
        "what",
        "setting",
        "times real time per core",
        "median error, in",
        "worst error, in",
        "gaits failed",
    ]
    rows = []
    for method in measurement.methods:
        errors = method.errors(measurement.counted)
        rows.append(
            [
                method.what,
                method.setting,
                _three_digits(method.real_time_factor),
                fixed(errors.median_in, 3),
                fixed(errors.worst_in, 3),
                str(method.failed),
            ]
        )
    return markdown_table(headings, rows, text_columns=(0, 1))


def _notes(measurement: Measurement) -> str:
    lines = [
        "Times are from gait to distance. Errors are of the distance, against converged runs of "
        f"the compiled engine (tolerance {CONVERGED_COMPILED.tolerance_mm_s:g} mm/s).",
    ]
    if measurement.mujoco_from_ours_in is None:
        lines.append(f"MuJoCo: not installed: {INSTALL}")
    else:
        integrator, step_ms = REFERENCE
        apart = fixed(measurement.mujoco_from_ours_in)
        lines.append(
            f"MuJoCo's are against its own {integrator} at {step_ms:g} ms; its ground is another "
            f"than ours, and its distances are {apart} in (median) from ours."
        )
    return "\n".join(lines)


def _step_table(measurement: Measurement) -> str:
    headings = ["tetrahedra", "steps", "us a step", "us a step and tetrahedron"]
    rows = [
        [
            str(cost.tetrahedra),
            str(cost.steps),
            fixed(cost.microseconds, 1),
            fixed(cost.microseconds / cost.tetrahedra, 2),
        ]
        for cost in measurement.step_costs
    ]
    return markdown_table(headings, rows, text_columns=())


def _method_to_json(method: Method, measurement: Measurement) -> dict[str, Any]:
    errors = method.errors(measurement.counted)
    return {
        "what": method.what,
        "setting": method.setting,
        "cores": method.cores,
        "simulated_s": method.simulated,
        "wall_time_s": method.wall_time,
        "real_time_factor_per_core": _or_null(method.real_time_factor),
        "median_error_in": _or_null(errors.median_in),
        "worst_error_in": _or_null(errors.worst_in),
        "failed": method.failed,
        "distances_in": [_or_null(distance) for distance in method.distances_in],
        "exact_in": [_or_null(distance) for distance in method.exact_in.tolist()],
    }


def _or_null(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def _three_digits(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "-"


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"
