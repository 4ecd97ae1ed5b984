"""A tetrahedron on an incline under Coulomb friction: it holds, creeps, slides, and stops.

    python diagrams/tetrahedron_on_incline.py

The diagram is made by one_tetrahedron.py, with the friction `!Coulomb`. Four motions are simulated:

- It holds on a slope with a tangent below the coefficient, if the bristles are as stiff as the
  ground. The nodes move by the stretch of the bristles.
- It creeps on the same slope without stiffness. Friction at rest is then only damping, the known
  limit of regularised friction.
- It slides on a steeper slope, with the acceleration g (sin - mu cos); mu is the kinetic
  coefficient.
- Thrown uphill, it decelerates by g (sin + mu cos) and stops.

The uphill node bears the least weight, so it slips first. All three nodes hold up to
tan = mu / (1 + mu / sqrt(2)) with the static mu; 23 degrees here.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from block_diagram import OUT
from matplotlib.figure import Figure
from one_tetrahedron import BASE, Samples, let_go, make_standing_tetrahedron, start_axes, weight

from tetra_drake.figures.style import OKABE_ITO, common_style, make_figure, save_figure
from tetra_drake.laws.friction import Coulomb
from tetra_drake.laws.terrain import Incline
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.units import INCH, POUND_FORCE

GENTLE, STEEP = math.radians(10.0), math.radians(35.0)
STATIC, KINETIC = 0.6, 0.5
STIFFNESS = 25.0 * POUND_FORCE / INCH  # of a bristle, N/m
DAMPING = 0.4 * POUND_FORCE / INCH  # N s/m: with the stiffness, a bristle settles within 16 ms
SPEED = 40.0 * INCH  # m/s
ANALYTIC: Any = {"color": "black", "linestyle": (0, (4, 3)), "linewidth": 1.0}
OURS: Any = [
    {"color": OKABE_ITO[colour], "linestyle": "-", "linewidth": 3.0}
    for colour in ("sky_blue", "orange")
]


@dataclass(frozen=True)
class Motion(Samples):
    """Motion along the slope: arrays (samples,), positive uphill."""

    travel: np.ndarray  # displacement of the base, m
    velocity: np.ndarray  # of the base, m/s
    friction_ratio: np.ndarray  # friction over normal force, of all nodes together

    def stopping(self) -> tuple[float, float]:
        """Time (s) and displacement (m) at the stop of a tetrahedron thrown uphill."""
        first = int(np.argmax(self.velocity <= 0.0))
        return float(self.times[first]), float(self.travel[first])


def on_incline(slope: float, *, stiffness: float = STIFFNESS) -> Scenario:
    """The thesis's ground, tilted by `slope` (rad), with Coulomb friction."""
    law = Coulomb(static=STATIC, kinetic=KINETIC, stiffness=stiffness, damping=DAMPING)
    return load_scenario("thesis").with_changes(
        {"name": "tetrahedron_on_incline", "terrain": Incline(slope=slope), "friction": law}
    )


def simulate(scenario: Scenario, *, speed: float = 0.0, duration: float) -> Motion:
    """Simulates a start at `speed` (m/s) up the slope, at the height where the ground bears the
    weight."""
    depth = parts_of_weight(scenario)[1] / (len(BASE) * scenario.ground.stiffness)
    samples = let_go(scenario, height=-depth, velocity=[speed, 0.0, 0.0], duration=duration)
    uphill = start_axes(make_standing_tetrahedron(scenario).structure)[0]
    friction = samples.friction_forces[:, :, 0].sum(axis=1)
    return Motion(
        **vars(samples),
        travel=(samples.p_WN - samples.p_WN[0])[:, BASE].mean(axis=1) @ uphill,
        velocity=samples.v_WN[:, BASE].mean(axis=1) @ uphill,
        friction_ratio=friction / samples.normal_forces.sum(axis=1),
    )


# Analytic solutions.


def parts_of_weight(scenario: Scenario) -> tuple[float, float]:
    """Components of the weight (N): down the slope, and into it."""
    assert isinstance(scenario.terrain, Incline)
    slope = scenario.terrain.slope
    return weight(scenario) * math.sin(slope), weight(scenario) * math.cos(slope)


def deflection(scenario: Scenario) -> float:
    """Stretch (m) of the bristles of all nodes under the weight."""
    return parts_of_weight(scenario)[0] / (len(BASE) * STIFFNESS)


def creep_speed(scenario: Scenario) -> float:
    """Creeping speed (m/s): damping alone bears the weight."""
    return parts_of_weight(scenario)[0] / (len(BASE) * DAMPING)


def acceleration(scenario: Scenario, *, way: float) -> float:
    """Acceleration (m/s²) up the slope of a tetrahedron that slides up (`way` 1) or down (-1)."""
    down, into = parts_of_weight(scenario)
    return -scenario.robot.gravity * (down + way * KINETIC * into) / weight(scenario)


Curves = dict[str, tuple[Motion, np.ndarray]]
"""Motions by label, each with its theoretical displacement (m)."""


@common_style()
def draw(*, resting: Curves, moving: Curves) -> Figure:
    """Draws the displacement of tetrahedra that hold, and displacement and friction / normal force
    of tetrahedra that move."""
    figure, axes = make_figure(width_in=7.0, height_in=8.0, rows=3)
    rest, way, ratio = axes[:, 0]
    panels = (rest, resting, 1e-3, 1e-3 * INCH), (way, moving, 1.0, INCH)
    for panel, curves, second, length in panels:
        for (label, (motion, theory)), style in zip(curves.items(), OURS, strict=True):
            times = motion.times / second
            panel.plot(times, motion.travel / length, label=label, **style)
            panel.plot(times, theory / length, **ANALYTIC)
        panel.lines[-1].set_label("analytic")
        panel.set_xlim(0.0, times[-1])
        panel.legend(loc="lower left")
    rest.set(ylabel="travel uphill (0.001 in)", xlabel="time (ms)")
    way.set_ylabel("travel uphill (in)")
    for (motion, _), style in zip(moving.values(), OURS, strict=True):
        ratio.plot(motion.times, motion.friction_ratio, **style)
    for label, level in (("μ", KINETIC), ("tan 10°", math.tan(GENTLE)), ("-μ", -KINETIC)):
        ratio.axhline(level, **ANALYTIC)
        ratio.annotate(label, (1.01, level), xycoords=("axes fraction", "data"), va="center")
    ratio.set(xlim=way.get_xlim(), xlabel="time (s)", ylabel="friction uphill / normal force")
    figure.align_ylabels()
    figure.suptitle("A tetrahedron on an incline under Coulomb friction")
    return figure


def main(out: Path = OUT) -> None:
    """Simulates the motions, prints their numbers and writes the pictures."""
    gentle, soft, steep = on_incline(GENTLE), on_incline(GENTLE, stiffness=0.0), on_incline(STEEP)
    holding, creeping = simulate(gentle, duration=0.1), simulate(soft, duration=0.1)
    sliding, thrown = simulate(steep, duration=0.3), simulate(gentle, speed=SPEED, duration=0.3)

    stretch, creep = deflection(gentle), creep_speed(soft)
    a_down, a_up = acceleration(steep, way=-1.0), acceleration(gentle, way=1.0)
    stop = -SPEED / a_up
    until_stop = np.minimum(thrown.times, stop)
    held = stretch * np.expm1(-STIFFNESS / DAMPING * holding.times)
    crept = -creep * creeping.times
    slid = 0.5 * a_down * sliding.times**2
    flown = SPEED * until_stop + 0.5 * a_up * until_stop**2
    figure = draw(
        resting={"let go on 10°": (holding, held), "the same, no stiffness": (creeping, crept)},
        moving={"let go on 35°": (sliding, slid), "thrown uphill on 10°": (thrown, flown)},
    )
    save_figure(figure, out, "tetrahedron_on_incline_motion", kinds=["svg"])

    half = slice(len(sliding.times) // 2, None)  # where all nodes slip
    gained, taken = np.ptp(sliding.velocity[half]), np.ptp(sliding.times[half])
    time, way = thrown.stopping()
    print("ours and analytic:")
    for what, ours, analytic, unit in (
        ("holds after", -holding.travel[-1], stretch, "in"),
        ("creeps without stiffness at", -creeping.velocity[-1], creep, "in/s"),
        ("slides down at", gained / taken, -a_down, "in/s^2"),
        ("thrown uphill stops after", way, 0.5 * SPEED * stop, "in"),
    ):
        print(f"{what} {ours / INCH:.4g} {unit}, {analytic / INCH:.4g} {unit}")
    print(f"that takes {time:.4f} s, {stop:.4f} s")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", nargs="?", type=Path, default=OUT)
    main(parser.parse_args().out)
