"""One tetrahedron on the ground: the diagram that settling_node.py, sliding_tetrahedron.py and
tetrahedron_on_incline.py simulate.

    ground ──→ plant ──┬──→ state
      ↑                │
      └────────────────┘

The tetrahedron stands on its base triangle: `top` in front, the two bottom nodes behind. The bottom
nodes move alike. On an incline the tetrahedron is turned with the slope.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from live import SignalCurves
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import Meshcat
from pydrake.math import RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput

from tetra_drake.laws.contact import MODE_COLUMNS, STICK_POINT
from tetra_drake.laws.kinematics import P_WN, V_WN
from tetra_drake.robot.robot import Robot, make_model
from tetra_drake.robot.structure import AddBodies, AddNodes, Structure, moved_nodes
from tetra_drake.scenario.robot_tetrahedra import BOTTOM_LEFT, BOTTOM_RIGHT, STRUTS, TOP
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.systems import AddGroundContact
from tetra_drake.visualization.scene import add_robot

BASE = BOTTOM_LEFT, BOTTOM_RIGHT, TOP
LEADING, TRAILING = TOP, BOTTOM_LEFT
R_WB = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])
"""Rotation from the pose in the robot to a tetrahedron that stands on its base."""


@dataclass(frozen=True)
class Samples:
    """Motion of the tetrahedron: samples at the ends of steps, in SI units. Contact nodes are in
    the order of BASE."""

    times: np.ndarray
    """Times (samples,)."""
    p_WN: np.ndarray
    v_WN: np.ndarray
    """Positions and velocities of the nodes (samples, 4, 3)."""
    normal_forces: np.ndarray
    """Normal forces (samples, 3)."""
    friction_forces: np.ndarray
    """Friction forces along t1 and t2 (samples, 3, 2); on flat ground along x and y."""
    modes: np.ndarray
    """Modes (samples, 3, 3): contact, and friction modes along t1 and t2; see GroundContact."""
    stick_points: np.ndarray
    """Stick points along x (samples, 3)."""


def make_standing_tetrahedron(scenario: Scenario) -> Robot:
    """One tetrahedron of the robot without cables. Its base is on the ground around the origin.

    Its body frame is turned, too. The inertia stays the same, because it is equal about all axes.
    """
    row = scenario.robot.blueprint()
    nodes, struts = row.first_node[1], len(STRUTS)
    p_FN = row.p_FN[:nodes] @ R_WB.T
    blueprint = dataclasses.replace(
        row,
        bodies=row.bodies[:1],
        node_names=row.node_names[:nodes],
        first_node=row.first_node[:2],
        p_WF=row.p_WF[:1],
        p_FN=p_FN,
        struts=row.struts[:struts],
        strut_radius=row.strut_radius[:struts],
        strut_density=row.strut_density[:struts],
        node_radius=row.node_radius[:nodes],
        node_density=row.node_density[:nodes],
        node_mass=row.node_mass[:nodes],
        anchor_stiffness=row.anchor_stiffness[:nodes],
        anchor_damping=row.anchor_damping[:nodes],
        payload=row.payload[:1],
        cable_names=(),
        cable_groups=(),
        cable_ends=row.cable_ends[:0],
        cable_laws=(),
        oscillators=(),
        groups=(),
        contacts=np.array(BASE),
        markers=row.markers[:2],
    )
    start = Robot.of(scenario).structure
    p_WB, q_WB = -p_FN[TRAILING, 2] * start_axes(start)[None, 2], start.q_WB[:1]
    tetrahedron = dataclasses.replace(Structure.of(blueprint), p_WB=p_WB, q_WB=q_WB)
    return Robot(scenario, tetrahedron, make_model(scenario, tetrahedron), np.zeros(0))


def start_axes(structure: Structure) -> np.ndarray:
    """Tangents t1 and t2 and normal of the ground at the start, as rows (3, 3)."""
    return RotationMatrix(Quaternion(structure.q_WB[0])).matrix().T


def make_diagram(scenario: Scenario, *, meshcat: Meshcat | None = None) -> Diagram:
    """Diagram of the tetrahedron and the ground, with logs of their outputs. With `meshcat` it
    shows the tetrahedron and the friction of its nodes."""
    tetrahedron = make_standing_tetrahedron(scenario)
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", MultibodyPlant(time_step=0.0))
    structure = tetrahedron.structure
    nodes = AddNodes(plant, structure, AddBodies(plant, structure))
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -scenario.robot.gravity])
    plant.Finalize()
    base = [nodes[node] for node in BASE]
    ground = AddGroundContact(builder, plant, frames=base, ground=tetrahedron.ground, witness=True)

    state = plant.get_state_output_port()
    LogVectorOutput(state, builder).set_name("state_log")
    for port in ("normal_forces", "friction_forces", "modes", "mode_table"):
        LogVectorOutput(ground.GetOutputPort(port), builder).set_name(f"{port}_log")
    if meshcat:
        add_robot(meshcat, tetrahedron.structure)
        body = f"/robot/{tetrahedron.structure.bodies[0]}"
        friction = ground.GetOutputPort("friction_forces")
        curves = SignalCurves(meshcat, count=friction.size(), window=0.1, scale=2.0, body=body)
        builder.AddNamedSystem("curves", curves)
        builder.Connect(friction, curves.GetInputPort("signals"))
        builder.Connect(state, curves.GetInputPort("state"))
    return builder.Build()


def let_go(
    scenario: Scenario,
    *,
    height: float,
    velocity: Sequence[float],
    duration: float,
    meshcat: Meshcat | None = None,
) -> Samples:
    """Simulates the tetrahedron. It starts with its base at `height` (m) above the ground, with a
    `velocity` (3,) in m/s along t1, t2 and the ground's normal. With `meshcat` it is shown, a
    hundred times slower."""
    tetrahedron = make_standing_tetrahedron(scenario).structure
    diagram = make_diagram(scenario, meshcat=meshcat)
    simulator = Simulator(diagram)
    simulator.set_target_realtime_rate(0.01 if meshcat else 0.0)
    ResetIntegratorFromFlags(simulator, "runge_kutta3", 1e-4).set_target_accuracy(1e-4)
    context = simulator.get_mutable_context()
    context.SetAccuracy(1e-4)  # localises contact and stiction changes to 1e-4 times 0.01 s

    start = tetrahedron.initial_state  # [q; v]: quaternion, position, angular velocity, velocity
    axes = start_axes(tetrahedron)
    start[4:7] += height * axes[2]
    start[10:] = velocity @ axes
    plant = diagram.GetSubsystemByName("plant")
    plant.SetPositionsAndVelocities(plant.GetMyMutableContextFromRoot(context), start)
    simulator.AdvanceTo(duration)

    def logged(port: str) -> np.ndarray:
        return diagram.GetSubsystemByName(f"{port}_log").FindLog(context).data().T

    nodes = np.array([moved_nodes(tetrahedron, state) for state in logged("state")])
    return Samples(
        times=diagram.GetSubsystemByName("state_log").FindLog(context).sample_times(),
        p_WN=nodes[..., P_WN : P_WN + 3],
        v_WN=nodes[..., V_WN : V_WN + 3],
        normal_forces=logged("normal_forces"),
        friction_forces=logged("friction_forces").reshape(-1, len(BASE), 2),
        modes=logged("modes").reshape(-1, len(BASE), 3),
        stick_points=logged("mode_table").reshape(-1, len(BASE), MODE_COLUMNS)[..., STICK_POINT],
    )


def weight(scenario: Scenario) -> float:
    """Weight of one tetrahedron in N."""
    return make_standing_tetrahedron(scenario).weight
