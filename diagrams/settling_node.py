"""One tetrahedron let go from just above the ground (thesis Fig. 5).

It stands on its base triangle, so that the three nodes it lands on share its weight and move
alike. Writes the block diagram and the figure, and prints impact speed and restitution
beside the thesis's.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib import style
from matplotlib.figure import Figure
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialVelocity
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput

from tetra_drake import thesis
from tetra_drake.diagram import AddGround, AddPlant
from tetra_drake.errors import InputError
from tetra_drake.figures.block_diagram import save_block_diagram
from tetra_drake.files import whole_file
from tetra_drake.robot import (
    BASE,
    BOTTOM_LEFT,
    MakeStructure,
    Structure,
    node_positions,
    node_velocities,
    tetrahedron_inertia,
)
from tetra_drake.scenario import Scenario, SimulationScenario, load_scenario
from tetra_drake.simulation import MakeSimulator
from tetra_drake.units import INCH, POUND_FORCE

R_WB = RotationMatrix([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])
"""Turns a tetrahedron so that its tip points up and its `top` node forward."""

DURATION = 0.04  # s


@dataclass(frozen=True)
class Motion:
    """A recorded motion of one tetrahedron, sampled at the end of each step, in SI units.

    Contact nodes are those of the base triangle, in the order of `robot.BASE`.
    """

    times: np.ndarray
    """(samples,)."""
    p_WN: np.ndarray
    """(samples, 4, 3): positions of the nodes."""
    v_WN: np.ndarray
    """(samples, 4, 3): velocities of the nodes."""
    normal_forces: np.ndarray
    """(samples, 3): by contact node."""
    friction_forces: np.ndarray
    """(samples, 3, 2): by contact node, along x and y."""
    modes: np.ndarray
    """(samples, 3, 3): by contact node, contact and friction modes as GroundContact has them."""


def MakeTetrahedron(scenario: Scenario) -> Structure:
    """The scenario's tetrahedron alone, without cables, with its base triangle at height 0.

    It stands so when turned by R_WB.
    """
    robot = MakeStructure(scenario.robot, scenario.cables)
    base = R_WB.multiply(robot.p_BN[BOTTOM_LEFT])
    return dataclasses.replace(
        robot,
        bodies=("T1",),
        p_WB=np.array([[0.0, 0.0, -base[2]]]),
        cables=robot.cables[:0],
        cable_names=(),
        contacts=np.array(BASE),
    )


def MakeTetrahedronDiagram(scenario: Scenario) -> Diagram:
    """One tetrahedron and the ground under its base triangle.

        plant -> state -> ground -> plant

    Subsystems: plant, ground, and a log of each port that Motion holds, called after the
    port: state_log, normal_forces_log, friction_forces_log, modes_log.
    """
    tetrahedron = MakeTetrahedron(scenario)
    builder = DiagramBuilder()
    plant = AddPlant(builder, scenario, tetrahedron)
    ground = AddGround(builder, scenario, tetrahedron)
    state = plant.get_state_output_port()
    builder.Connect(state, ground.GetInputPort("state"))
    builder.Connect(
        ground.GetOutputPort("generalized_force"),
        plant.get_applied_generalized_force_input_port(),
    )
    LogVectorOutput(state, builder).set_name("state_log")
    for port in ("normal_forces", "friction_forces", "modes"):
        LogVectorOutput(ground.GetOutputPort(port), builder).set_name(f"{port}_log")
    diagram = builder.Build()
    diagram.set_name("tetrahedron_on_the_ground")
    return diagram


def simulate(
    scenario: Scenario, *, height: float, velocity: Sequence[float], duration: float
) -> Motion:
    """Lets the tetrahedron go with its base triangle at `height` (m) and `velocity` (m/s)."""
    scenario = dataclasses.replace(scenario, simulation=_fine(scenario.simulation))
    diagram = MakeTetrahedronDiagram(scenario)
    tetrahedron = MakeTetrahedron(scenario)
    simulator = MakeSimulator(diagram, scenario.simulation)
    context = simulator.get_mutable_context()

    plant = diagram.GetSubsystemByName("plant")
    plant_context = plant.GetMyMutableContextFromRoot(context)
    body = plant.GetBodyByName("T1")
    X_WB = RigidTransform(R_WB, tetrahedron.p_WB[0] + [0.0, 0.0, height])
    plant.SetFreeBodyPose(plant_context, body, X_WB)
    V_WB = SpatialVelocity(w=np.zeros(3), v=velocity)
    plant.SetFreeBodySpatialVelocity(context=plant_context, body=body, V_JpJc=V_WB)

    simulator.AdvanceTo(duration)
    return _read_logs(diagram, context, tetrahedron)


def _fine(settings: SimulationScenario) -> SimulationScenario:
    """Settings for motions that are over in some ms: modes change where witnesses say."""
    return dataclasses.replace(
        settings,
        scheme="runge_kutta3",
        accuracy=1e-4,
        max_step=1e-4,
        mode_changes="witness",
        witness_window=1e-6,
    )


def _read_logs(diagram: Diagram, context: Context, tetrahedron: Structure) -> Motion:
    logs = {
        port: diagram.GetSubsystemByName(f"{port}_log").FindLog(context)
        for port in ("state", "normal_forces", "friction_forces", "modes")
    }
    data = {port: log.data().T for port, log in logs.items()}
    contacts = len(tetrahedron.contacts)
    return Motion(
        times=logs["state"].sample_times(),
        p_WN=np.array([node_positions(tetrahedron, state) for state in data["state"]]),
        v_WN=np.array([node_velocities(tetrahedron, state) for state in data["state"]]),
        normal_forces=data["normal_forces"],
        friction_forces=data["friction_forces"].reshape(-1, contacts, 2),
        modes=data["modes"].reshape(-1, contacts, 3),
    )


def settle(scenario: Scenario, *, impact_speed: float, duration: float = DURATION) -> Motion:
    """Lets the tetrahedron go at rest, from where it falls to `impact_speed` (m/s)."""
    height = impact_speed**2 / (2.0 * scenario.robot.gravity)
    return simulate(scenario, height=height, velocity=[0.0, 0.0, 0.0], duration=duration)


def bounce(scenario: Scenario, *, impact_speed: float, duration: float = DURATION) -> Motion:
    """The same impact without weight, which is the impact that Eq. 2 is about.

    It meets the ground when the tetrahedron of settle() does.
    """
    weightless = dataclasses.replace(scenario.robot, gravity=0.0)
    return simulate(
        dataclasses.replace(scenario, robot=weightless),
        height=impact_speed**2 / scenario.robot.gravity,
        velocity=[0.0, 0.0, -impact_speed],
        duration=duration,
    )


def first_contact(motion: Motion) -> tuple[float, float]:
    """Speed (m/s) at which the first node meets the ground and at which it leaves it again;
    nan for what does not happen."""
    height, rate = motion.p_WN[:, BOTTOM_LEFT, 2], motion.v_WN[:, BOTTOM_LEFT, 2]
    below = np.flatnonzero(height <= 0.0)
    if below.size == 0:
        return np.nan, np.nan
    above = np.flatnonzero(height[below[0] :] > 0.0)
    rebound = float(rate[below[0] + above[0]]) if above.size else np.nan
    return -float(rate[below[0]]), rebound


def draw(settling: Motion, bouncing: Motion) -> Figure:
    """Height and normal force of one node over time, with and without weight."""
    with style.context("tableau-colorblind10"):
        figure = Figure(figsize=(8, 5.5), layout="constrained")
        above, below = figure.subplots(2, 1, sharex=True)
    for motion, label, line in (
        (settling, "let go from just above the ground (Fig. 5)", "-"),
        (bouncing, "the same impact without weight", "--"),
    ):
        milliseconds = 1e3 * motion.times
        above.plot(milliseconds, 1e3 * motion.p_WN[:, BOTTOM_LEFT, 2] / INCH, line, label=label)
        below.plot(milliseconds, motion.normal_forces[:, BOTTOM_LEFT] / POUND_FORCE, line)
    # Without weight it flies away: the axis shows the settling.
    above.set_ylim(-1.05, 0.35)
    above.axhline(0.0, color="black", linewidth=0.8)
    above.set_ylabel("height of the node (0.001 in)")
    above.legend()
    below.set_ylabel("normal force on the node (lbf)")
    below.set_xlabel("time (ms)")
    for panel in (above, below):
        panel.margins(x=0)
        panel.grid(alpha=0.4)
    return figure


def report(scenario: Scenario, settling: Motion, bouncing: Motion) -> str:
    """Impact speed, restitution and final load, the thesis's beside ours."""
    impact, rebound = first_contact(settling)
    speed, speed_after = first_contact(bouncing)
    linear = 1.0 - scenario.ground.velocity_correction * speed
    mass = tetrahedron_inertia(MakeTetrahedron(scenario)).get_mass()
    load = settling.normal_forces[-1].sum() / (mass * scenario.robot.gravity)
    depth = -settling.p_WN[-1, BOTTOM_LEFT, 2]
    after = "it does not leave the ground again" if np.isnan(rebound) else "it leaves it again"
    return (
        f"impact speed {impact / INCH:.3f} in/s "
        f"(thesis: about {thesis.SETTLING_IMPACT_SPEED_IN_S:g}); {after}; it rests "
        f"{depth / INCH:.5f} in deep on {load:.3f} of its weight\n"
        f"restitution without weight {speed_after / speed:.3f} "
        f"(Eq. 2, e = 1 - alpha v: {linear:.3f}; thesis: {thesis.SETTLING_RESTITUTION:g})"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Writes the pictures and prints the numbers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path(__file__).parent)
    options = parser.parse_args(arguments)
    scenario = load_scenario("thesis")
    impact_speed = thesis.SETTLING_IMPACT_SPEED_IN_S * INCH
    settling = settle(scenario, impact_speed=impact_speed)
    bouncing = bounce(scenario, impact_speed=impact_speed)
    try:
        save_block_diagram(MakeTetrahedronDiagram(scenario), options.out / "settling_node.svg")
        with whole_file(options.out / "settling_node.png") as file:
            draw(settling, bouncing).savefig(file, dpi=100)
    except InputError as error:
        parser.error(str(error))
    print(report(scenario, settling, bouncing))
    return 0


if __name__ == "__main__":
    sys.exit(main())
