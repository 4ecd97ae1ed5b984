"""Readings of robots: what their sensors could measure, and the truth about their motion."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple, Self

import numpy as np

from tetra_drake.kernels.packed import allocate
from tetra_drake.laws import cable, contact, kinematics
from tetra_drake.laws.forces import forces_of_motion
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import Structure, moved_nodes, with_origins


class Readings(NamedTuple):
    """Readings of N robots at an instant, in SI units.

    The readings of a single robot lack the first axis. The names of nodes, cables,
    bodies and contacts are in `Simulation.robot.structure`.
    """

    time: Annotated[Any, "robots"]
    """Time (N,)."""
    lengths: Annotated[Any, "robots", "cables"]
    """Lengths of the cables (N, cables)."""
    rates: Annotated[np.ndarray, "robots", "cables"]
    """Rates of the lengths (N, cables)."""
    tensions: Annotated[np.ndarray, "robots", "cables"]
    """Tensions of the cables (N, cables)."""
    normal_forces: Annotated[np.ndarray, "robots", "contacts"]
    """Loads of the contact nodes (N, contacts), along the normal of the ground."""
    q_WB: Annotated[np.ndarray, "robots", "bodies", 4]
    """Orientations of the bodies (N, bodies, 4): quaternions, w first."""
    w_WB: Annotated[np.ndarray, "robots", "bodies", 3]
    """Angular velocities of the bodies (N, bodies, 3)."""
    p_WN: Annotated[np.ndarray, "robots", "nodes", 3]
    """Positions of the nodes (N, nodes, 3)."""
    v_WN: Annotated[np.ndarray, "robots", "nodes", 3]
    """Velocities of the nodes (N, nodes, 3)."""

    @classmethod
    def empty(cls, structure: Structure, count: int) -> Self:
        """Readings with room for `count` robots of a structure; fill them with put()."""
        sizes = {
            "robots": count,
            "cables": len(structure.cables),
            "contacts": len(structure.contacts),
            "bodies": len(structure.bodies),
            "nodes": len(structure.node_names),
        }
        return allocate(cls, sizes)

    @classmethod
    def of(
        cls,
        structure: Structure,
        *,
        time: float,
        state: np.ndarray,
        cable_forces: np.ndarray,
        ground_forces: np.ndarray,
    ) -> Self:
        """The readings of one robot at a time (s), as copies.

        They are from the state [q; v] (13*n,) of its bodies at that time, the table `cable_forces`
        (cables, 7) of laws.cable (length, rate and tension of each cable), and the table
        `ground_forces` (contacts, 3) of laws.contact (friction along t1 and t2, normal force)."""
        nodes, bodies = moved_nodes(structure, state), len(structure.bodies)
        return cls(
            time=time,
            lengths=cable_forces[:, cable.LENGTH].copy(),
            rates=cable_forces[:, cable.RATE].copy(),
            tensions=cable_forces[:, cable.TENSION].copy(),
            normal_forces=ground_forces[:, contact.NORMAL].copy(),
            q_WB=state[: 7 * bodies].reshape(bodies, 7)[:, :4].copy(),
            w_WB=state[7 * bodies :].reshape(bodies, 6)[:, :3].copy(),
            p_WN=nodes[:, kinematics.P_WN : kinematics.P_WN + 3],
            v_WN=nodes[:, kinematics.V_WN : kinematics.V_WN + 3],
        )

    def rows(self, which: int | slice | list[int]) -> Self:
        """Readings of some of the N robots: of one (`which` is an index; without the first axis) or
        of several. With an index or a slice they are views: they change with these readings."""
        return type(self)(*(values[which] for values in self))

    def copied(self) -> Self:
        """A copy of the readings, which does not change with them."""
        return type(self)(*(values.copy() for values in self))

    def put(self, place: int, readings: Readings) -> None:
        """Writes the `readings` of a single robot into these arrays of N robots, at index `place`
        of the first axis."""
        for values, given in zip(self, readings, strict=True):
            values[place] = given


def first_readings(robot: Robot) -> Readings:
    """The readings of a robot at its start, t = 0, without a simulation."""
    return readings_at(
        robot,
        time=0.0,
        state=robot.structure.initial_state,
        modes=robot.starting_modes,
        signals=robot.first_signals,
        drives=robot.starting_drives(),
    )


def readings_at(
    robot: Robot,
    *,
    time: float,
    state: np.ndarray,
    modes: np.ndarray,
    signals: np.ndarray,
    drives: np.ndarray,
    ground_forces: np.ndarray | None = None,
) -> Readings:
    """The readings of one robot, computed from its full state at a time (s).

    Args:
        state: state [q; v] (13*n,) of the bodies.
        modes: table `modes` (contacts, 12) with the contact state of each contact node, such as its
            stick point; see laws.contact.
        signals: signals of the m oscillators, or of given actuators, (m,) in N.
        drives: states of the actuators (drives,), such as free lengths; see laws.actuator.
        ground_forces: forces (contacts, 3) in N along t1, t2 and n from an engine with its own law
            of contact. By default they are computed from state and modes.
    """
    _, cables, ground = forces_of_motion(
        robot.model, state[np.newaxis], modes[np.newaxis], signals[np.newaxis], drives[np.newaxis]
    )
    return Readings.of(
        robot.structure,
        time=time,
        state=state,
        cable_forces=cables[0],
        ground_forces=ground[0] if ground_forces is None else ground_forces,
    )


def bodies_state(readings: Readings, structure: Structure) -> np.ndarray:
    """State [q; v] (13*n,) of the n bodies of one robot with these readings, from the orientations
    of the bodies and the first node of each."""
    first = structure.first_node[:-1]
    poses = np.hstack([readings.q_WB, readings.p_WN[first]])
    velocities = np.hstack([readings.w_WB, readings.v_WN[first]])
    state = np.concatenate([poses.ravel(), velocities.ravel()])
    return with_origins(state, -structure.p_BN[first])
