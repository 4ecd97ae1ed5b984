"""The tables of a benchmark in Markdown."""

from __future__ import annotations

from typing import Any

from tetra_drake.benchmark.measure import CLOSE_IN, GROUND_BATCH, LANES, ROUNDS
from tetra_drake.engines.mujoco import INSTALL
from tetra_drake.formatting import fixed, listed, markdown_table

SETTINGS = {
    "engine": ("engine", "{}"),
    "setting": ("setting", "{}"),
    "real_time_factor_per_core": ("times real time per core", "{:.3g}"),
    "median_error_in": ("median error, in", "{:.3f}"),
    "worst_error_in": ("worst error, in", "{:.3f}"),
    "evaluations": ("evaluations per gait", "{:,}"),
    "failed": ("failed", "{}"),
}
BATCHES = {
    "engine": ("engine", "{}"),
    "setting": ("setting", "{}"),
    "gaits": ("gaits at a time", "{}"),
    "cores": ("cores", "{}"),
    "real_time_factor_per_core": ("times real time per core", "{:,.1f}"),
    "real_time_factor": ("in total", "{:,.1f}"),
    "failed": ("failed", "{}"),
}
STEP_COSTS = {
    "tetrahedra": ("tetrahedra", "{}"),
    "steps": ("steps", "{:,}"),
    "microseconds_per_step": ("μs per step", "{:.1f}"),
    "microseconds_per_tetrahedron": ("μs per step and tetrahedron", "{:.2f}"),
    "microseconds_per_step_in_lanes": ("in lanes: μs per step", "{:.1f}"),
    "microseconds_per_tetrahedron_in_lanes": ("μs per step and tetrahedron", "{:.2f}"),
}
GROUNDS = {
    "ground": ("ground", "{}"),
    "steps": ("steps per gait", "{:,.0f}"),
    "compiled": ("times real time: compiled, one gait", "{:,.0f}"),
    "compiled_many": (f"{GROUND_BATCH} gaits", "{:,.0f}"),
    "drake": ("drake", "{:.2f}"),
}


def to_markdown(found: dict[str, Any]) -> str:
    """What `measure` has found: the settings, the cost per step, and what errors refer to."""
    left_out = [gait["name"] for gait in found["gaits"] if not gait["well_conditioned"]]
    parts = [
        f"Scenario {found['scenario']}, duration {found['duration_s']:g} s, gaits: "
        f"{len(found['gaits'])}, cores: {found['cores']}",
        _table(found["rows"], SETTINGS),
        "Times are from gait to result. Errors are of the distance, against converged runs of the "
        f"compiled engine ({found['converged']}), without ill-conditioned gaits, whose distances "
        f"in two converged runs differ by more than {CLOSE_IN:g} in: {listed(left_out)}.",
    ]
    mujoco = found["mujoco"]
    if mujoco["median_distance_from_ours_in"] is not None:
        apart = fixed(mujoco["median_distance_from_ours_in"])
        parts.append(
            f"MuJoCo's errors are against its own converged runs ({mujoco['converged']}): its "
            f"ground differs, and its distances differ by {apart} in (median) from ours."
        )
    elif mujoco["left_out"]:
        parts.append(
            f"Without MuJoCo: it is not installed ({INSTALL}), or cannot simulate the scenario."
        )
    if found["batches"]:
        parts.append(_table(found["batches"], BATCHES))
        parts.append(
            "Batches are of different random gaits, through simulate_many(); on each core MuJoCo's "
            f"rollout has a thread. Medians of {ROUNDS} measurements, from gaits to results."
        )
    if found["step_costs"]:
        parts.append(_table(found["step_costs"], STEP_COSTS))
        parts.append(
            "What a step of one gait takes a core on the compiled engine, without preparation: of "
            f"a gait alone, and of one of {LANES} that share the lanes of a core."
        )
    if found["grounds"]:
        parts.append(_table(found["grounds"], GROUNDS))
        parts.append("On one core; rough ground, which all nodes may touch, is that of `rough`.")
    return "\n\n".join(parts)


def _table(rows: list[dict[str, Any]], columns: dict[str, tuple[str, str]]) -> str:
    """Rows in Markdown; `columns` gives the heading and the format of each key."""
    cells = [
        ["-" if row[key] is None else form.format(row[key]) for key, (_, form) in columns.items()]
        for row in rows
    ]
    text = [i for i, key in enumerate(columns) if key in ("engine", "setting", "ground")]
    return markdown_table([heading for heading, _ in columns.values()], cells, text)
