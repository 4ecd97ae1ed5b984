"""The tables of a benchmark in Markdown."""

from __future__ import annotations

from typing import Any

from tetra_drake.benchmark.measure import CLOSE_IN
from tetra_drake.engines.mujoco import INSTALL
from tetra_drake.formatting import fixed, listed, markdown_table


def to_markdown(found: dict[str, Any]) -> str:
    """What `measure` has found: the settings, the cost per step, and what errors refer to."""
    left_out = [gait["name"] for gait in found["gaits"] if not gait["well_conditioned"]]
    parts = [
        f"Scenario {found['scenario']}, duration {found['duration_s']:g} s, gaits: "
        f"{len(found['gaits'])}, cores: {found['cores']}",
        _settings_table(found["rows"]),
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
        parts.append(f"Without MuJoCo: it is not installed ({INSTALL}), or cables may go slack.")
    if found["step_costs"]:
        parts.append(_cost_table(found["step_costs"]))
    return "\n\n".join(parts)


def _settings_table(rows: list[dict[str, Any]]) -> str:
    columns = {
        "real_time_factor_per_core": ("times real time per core", "{:.3g}"),
        "median_error_in": ("median error, in", "{:.3f}"),
        "worst_error_in": ("worst error, in", "{:.3f}"),
        "evaluations": ("evaluations per gait", "{:,}"),
        "failed": ("failed", "{}"),
    }
    headings = ["engine", "setting", *(heading for heading, _ in columns.values())]
    cells = [
        [
            row["engine"],
            row["setting"],
            *(_text(row[key], form) for key, (_, form) in columns.items()),
        ]
        for row in rows
    ]
    return markdown_table(headings, cells, text_columns=(0, 1))


def _cost_table(costs: list[dict[str, Any]]) -> str:
    headings = ["tetrahedra", "steps", "μs per step", "μs per step and tetrahedron"]
    cells = []
    for cost in costs:
        number, time = cost["tetrahedra"], cost["microseconds_per_step"]
        each = time and time / number
        steps = _text(cost["steps"], "{:,}")
        cells.append([str(number), steps, _text(time, "{:.1f}"), _text(each, "{:.2f}")])
    return markdown_table(headings, cells, text_columns=())


def _text(value: float | None, form: str) -> str:
    return "-" if value is None else form.format(value)
