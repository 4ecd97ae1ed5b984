"""A tetrahedron on an incline under Coulomb friction: it holds, creeps, slides, and stops.

    python diagrams/tetrahedron_on_incline.py

The diagram is that of one_tetrahedron.py, the friction `!Coulomb`, and gravity along World's -z. On
a slope whose tangent is below the coefficient, bristles as stiff as the ground hold it: the nodes
move by what stretches the bristles. Without stiffness, friction at rest is damping alone, and it
creeps: the known limit of regularised friction. On a steeper slope it slides at
g (sin - mu cos), and thrown uphill it decelerates by g (sin + mu cos), where mu is the kinetic
coefficient.

The uphill node carries least, so it slips first: all three hold up to
tan = mu / (1 + mu / sqrt(2)), mu static; 23 degrees here.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from one_tetrahedron import Samples, let_go, make_standing_tetrahedron, start_axes, weight

from tetra_drake.figures.style import OKABE_ITO, common_style, make_figure, save_figure
from tetra_drake.robot.structure import BASE
from tetra_drake.scenario.friction_kinds import Coulomb
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.terrain_kinds import Incline
from tetra_drake.scenario.units import INCH, POUND_FORCE

GENTLE, STEEP = math.radians(10.0), math.radians(35.0)
STATIC, KINETIC = 0.6, 0.5
STIFFNESS = 25.0 * POUND_FORCE / INCH
"""Stiffness of a bristle, N/m: with the damping, 0.4 lbf s/in, it settles within some 16 ms."""
SPEED = 40.0 * INCH  # m/s
ANALYTIC: Any = {"color": "black", "linestyle": (0, (4, 3)), "linewidth": 1.0}
OURS: Any = [
    {"color": OKABE_ITO[colour], "linestyle": "-", "linewidth": 3.0}
    for colour in ("sky_blue", "orange")
]
Runs = dict[str, tuple[Scenario, Samples]]


def on_incline(slope: float, *, stiffness: float = STIFFNESS) -> Scenario:
    """The thesis's ground, tilted by `slope` (rad), with Coulomb friction."""
    law = Coulomb(static=STATIC, kinetic=KINETIC, stiffness=stiffness)
    return load_scenario("thesis").with_changes(
        {"name": "tetrahedron_on_incline", "terrain": Incline(slope=slope), "friction": law}
    )


def start(scenario: Scenario, *, speed: float = 0.0, duration: float) -> Samples:
    """A start at `speed` (m/s) up the slope from where the ground bears the weight."""
    depth = parts_of_weight(scenario)[1] / (len(BASE) * scenario.ground.stiffness)
    return let_go(scenario, height=-depth, velocity=[speed, 0.0, 0.0], duration=duration)


def parts_of_weight(scenario: Scenario) -> tuple[float, float]:
    """The weight (N) down the slope and into it."""
    assert isinstance(scenario.terrain, Incline)
    slope = scenario.terrain.slope
    return weight(scenario) * math.sin(slope), weight(scenario) * math.cos(slope)


def uphill(scenario: Scenario) -> np.ndarray:
    """(3,): unit vector up the slope."""
    return start_axes(make_standing_tetrahedron(scenario).structure)[0]


def travel(motion: Samples, scenario: Scenario) -> np.ndarray:
    """(samples,): displacement of the base up the slope in m."""
    return (motion.p_WN - motion.p_WN[0])[:, BASE].mean(axis=1) @ uphill(scenario)


def velocity(motion: Samples, scenario: Scenario) -> np.ndarray:
    """(samples,): velocity of the base up the slope in m/s."""
    return motion.v_WN[:, BASE].mean(axis=1) @ uphill(scenario)


def friction_ratio(motion: Samples) -> np.ndarray:
    """(samples,): friction up the slope over normal force, of all nodes together."""
    return motion.friction_forces[:, :, 0].sum(axis=1) / motion.normal_forces.sum(axis=1)


def stopping(motion: Samples, scenario: Scenario) -> tuple[float, float]:
    """When (s) a tetrahedron thrown uphill stops, and how far up (m)."""
    first = int(np.argmax(velocity(motion, scenario) <= 0.0))
    return float(motion.times[first]), float(travel(motion, scenario)[first])


# The analytic answers.


def deflection(scenario: Scenario) -> float:
    """Stretch (m) of the bristles of all nodes under the weight."""
    assert isinstance(scenario.friction, Coulomb)
    return parts_of_weight(scenario)[0] / (len(BASE) * scenario.friction.stiffness)


def creep_speed(scenario: Scenario) -> float:
    """The speed (m/s) at which damping alone bears the weight."""
    assert isinstance(scenario.friction, Coulomb)
    return parts_of_weight(scenario)[0] / (len(BASE) * scenario.friction.damping)


def acceleration(scenario: Scenario, *, way: float) -> float:
    """Acceleration (m/s²) up the slope of a tetrahedron that slides up (`way` 1) or down (-1)."""
    law = scenario.friction
    assert isinstance(law, Coulomb)
    down, into = parts_of_weight(scenario)
    return -scenario.robot.gravity * (down + way * law.kinetic * into) / weight(scenario)


def analytic_travel(motion: Samples, scenario: Scenario) -> np.ndarray:
    """(samples,): what `travel` should be, by how the motion starts."""
    law, times, speed = scenario.friction, motion.times, float(velocity(motion, scenario)[0])
    assert isinstance(law, Coulomb)
    down, into = parts_of_weight(scenario)
    if speed > 0.0 or down > law.static * into:
        a = acceleration(scenario, way=1.0 if speed > 0.0 else -1.0)
        times = np.minimum(times, -speed / a) if speed > 0.0 else times
        return speed * times + 0.5 * a * times**2
    if law.stiffness == 0.0:
        return -creep_speed(scenario) * times
    return deflection(scenario) * np.expm1(-law.stiffness / law.damping * times)


@common_style()
def draw(*, resting: Runs, moving: Runs) -> Figure:
    """Travel at rest; travel of what moves, and its friction over normal force."""
    figure, axes = make_figure(width_in=7.0, height_in=8.0, rows=3)
    rest, way, ratio = axes[:, 0]
    for runs, panel, time, length in ((resting, rest, 1e3, 1e-3 * INCH), (moving, way, 1.0, INCH)):
        for (label, (scenario, motion)), style in zip(runs.items(), OURS, strict=True):
            times = time * motion.times
            panel.plot(times, travel(motion, scenario) / length, label=label, **style)
            panel.plot(times, analytic_travel(motion, scenario) / length, **ANALYTIC)
        panel.lines[-1].set_label("analytic")
        panel.set_xlim(0.0, time * motion.times[-1])
        panel.legend(loc="lower left")
    rest.set_ylabel("travel uphill (0.001 in)")
    rest.set_xlabel("time (ms)")
    way.set_ylabel("travel uphill (in)")
    for (_, motion), style in zip(moving.values(), OURS, strict=True):
        ratio.plot(motion.times, friction_ratio(motion), **style)
    levels = {"μ": KINETIC, "tan 10°": math.tan(GENTLE), "-μ": -KINETIC}
    for label, level in levels.items():
        ratio.axhline(level, **ANALYTIC)
        ratio.annotate(label, (1.01, level), xycoords=("axes fraction", "data"), va="center")
    ratio.set_xlim(way.get_xlim())
    ratio.set_ylabel("friction uphill / normal force")
    ratio.set_xlabel("time (s)")
    figure.align_ylabels()
    figure.suptitle("A tetrahedron on an incline under Coulomb friction")
    return figure


def main(out: Path = Path(__file__).parent) -> None:
    """Simulates the motions, prints their numbers and writes the pictures."""
    gentle, soft, steep = on_incline(GENTLE), on_incline(GENTLE, stiffness=0.0), on_incline(STEEP)
    holding, creeping = start(gentle, duration=0.1), start(soft, duration=0.1)
    sliding, up = start(steep, duration=0.3), start(gentle, speed=SPEED, duration=0.3)
    figure = draw(
        resting={"let go on 10°": (gentle, holding), "the same, no stiffness": (soft, creeping)},
        moving={"let go on 35°": (steep, sliding), "thrown uphill on 10°": (gentle, up)},
    )
    save_figure(figure, out, "tetrahedron_on_incline_motion", kinds=["svg"])

    speeds, middle = velocity(sliding, steep), len(sliding.times) // 2
    slid = (speeds[-1] - speeds[middle]) / (sliding.times[-1] - sliding.times[middle])
    time, way = stopping(up, gentle)
    stop = -SPEED / acceleration(gentle, way=1.0)
    print("ours and analytic:")
    for what, ours, analytic, unit in (
        ("holds after", -travel(holding, gentle)[-1], deflection(gentle), "in"),
        ("creeps without stiffness at", -velocity(creeping, soft)[-1], creep_speed(soft), "in/s"),
        ("slides down at", -slid, -acceleration(steep, way=-1.0), "in/s^2"),
        ("thrown uphill stops after", way, 0.5 * SPEED * stop, "in"),
    ):
        print(f"{what} {ours / INCH:.4g} {unit}, {analytic / INCH:.4g} {unit}")
    print(f"that takes {time:.4f} s, {stop:.4f} s")


if __name__ == "__main__":
    main()
