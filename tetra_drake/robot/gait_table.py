"""A gait as a table to read."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pandas as pd

from tetra_drake.robot.actuation import (
    Actuation,
    couplings_within,
    parse_weight_name,
    weight_names,
)
from tetra_drake.robot.gait import Gait
from tetra_drake.scenario.schema import Scenario


def gait_table(
    gait: Gait, scenario: Scenario, *, names: tuple[str, ...] = (), width: int | None = None
) -> str:
    """What a gait holds, as lines; it need not fit the scenario.

    The weights are a matrix for each kind of neuron. `names`, those of the weights as read_gait()
    gives them; without, the weights are in the scenario's order or, if these are not as many, in
    that of oscillators which all inhibit each other. Matrices wider than `width` are cut.
    """
    actuation = Actuation.of(scenario)
    names = names or _listing_names(len(gait.weights), actuation)
    weights = zip(map(parse_weight_name, names), gait.weights, strict=False)
    cells = {coupling: weight for coupling, weight in weights if coupling}
    known = range(1, len(actuation.names) + 1)
    oscillators = sorted({k for _, *pair in cells for k in pair}) or [*known]
    lines = [gait.name, *_settings(gait)]
    if hidden := len(gait.weights) - len(cells):
        lines.append(f"  {'not shown':<14}{hidden} weights")
    if oscillators == [*known]:
        lines += ["", f"oscillators of scenario {scenario.name}"]
        lines += [f"{k:>4}  {cables}" for k, cables in zip(known, actuation.cables, strict=True)]
    for kind in dict.fromkeys(kind for kind, *_ in cells):
        rows = [[cells.get((kind, i, j), math.nan) for j in oscillators] for i in oscillators]
        matrix = pd.DataFrame(rows, index=oscillators, columns=oscillators)
        text = matrix.to_string(na_rep="-", float_format="{:.2f}".format, line_width=width)
        lines += ["", f"inhibition of the {kind} of each row by that of each column", text]
    return "\n".join(lines)


def _settings(gait: Gait) -> list[str]:
    gains = [f"{name} {gain:.4g}" for name, gain in dataclasses.asdict(gait.gains).items() if gain]
    rows = {
        "tau_A": f"{gait.tau_a:.4g} s",
        "tau_B": f"{gait.tau_b:.4g} s, {gait.tau_b / gait.tau_a:.4g} tau_A",
        "turn": f"{gait.turn:.4g}" if gait.turn else "",
        "gains": ", ".join(gains),
    }
    return [f"  {name:<14}{text}" for name, text in rows.items() if text]


def _listing_names(count: int, actuation: Actuation) -> tuple[str, ...]:
    """The names of so many weights without names; none if that is the number of no network."""
    if count == len(actuation.couplings):
        return actuation.weight_names
    oscillators = round((1.0 + math.sqrt(1.0 + 2.0 * count)) / 2.0)  # 2 m (m - 1) weights
    names = weight_names(couplings_within(np.zeros(oscillators), None))
    return names if len(names) == count else ()
