"""Changes of contact and friction modes: their detection, and the prediction of their time."""

from __future__ import annotations

from tetra_drake.kernels.compiling import compiled, inlined
from tetra_drake.kernels.lanes import Real, Table, Truth, any_lane, minimum, named, select
from tetra_drake.kernels.packed import unpacked
from tetra_drake.laws import contact, friction
from tetra_drake.laws.forces import Forces, Parts, move_contacts
from tetra_drake.laws.kinematics import P_BN_W, node_acceleration
from tetra_drake.laws.model import Model
from tetra_drake.laws.terrain import to_frame
from tetra_drake.laws.vectors import cross, difference, sum_of, vector_at


@compiled
def modes_after_step(parts: Parts, state: Table, modes: Table) -> Truth:
    """Updates `modes` (contacts, 12), the contact and friction modes, for the state [q; v]
    (13*bodies,) at the end of a step. Returns True if a mode changed; see contact.update_modes().

    `parts` is a Model and its Forces. Also writes nodes and ground frames to the Forces.
    """
    robot, forces = unpacked(parts)
    move_contacts(robot, state, forces)
    return contact.update_modes(state, forces.nodes, robot.ground, forces.frames, modes)


@inlined
def time_to_mode_change(
    robot: Model, state: Table, acceleration: Table, modes: Table, forces: Forces, horizon: Real
) -> Real:
    """Predicted time (s) to the next change of a contact or friction mode, at most `horizon` (s).

    The prediction assumes constant accelerations of the nodes, and the tangent plane in place of
    the ground. `state` is [q; v] (13*bodies,). `acceleration` is dv/dt, 6 numbers per body. `modes`
    (contacts, 12) are the present modes, and are only read. `forces` has the nodes and ground
    frames of the state.
    """
    ground, nodes, frames = robot.ground, forces.nodes, forces.frames
    time, law = horizon, named(contact.NormalForce, ground.normal)
    for i in range(ground.contacts.size):
        centre, body = ground.centres[i], ground.carriers[i]
        a_WN = node_acceleration(state, acceleration, nodes, centre, body)
        if ground.is_round:
            # The lowest point moves with the contact, not with the material: its centripetal
            # acceleration is the node's.
            a, foot = 6 * body, ground.contacts[i]
            alpha = acceleration[a], acceleration[a + 1], acceleration[a + 2]
            drop = difference(vector_at(nodes, foot, P_BN_W), vector_at(nodes, centre, P_BN_W))
            a_WN = sum_of(a_WN, cross(alpha, drop))
        a_1, a_2, a_n = to_frame(a_WN, frames, i, ground.flat)
        slide, v_n = contact.sliding(state, nodes, modes, ground, frames, i)
        touches = modes[i, contact.CONTACT] != 0.0
        distance = contact.gap(nodes, ground, frames, i)
        up = select(touches, -1.0, 1.0)  # sign of the motion away from the surface
        time = minimum(time, friction.first_zero(up * distance, up * v_n, up * a_n, horizon))
        if not any_lane(touches):
            continue
        rate = law.damping * (v_n * v_n + distance * a_n) - law.stiffness * v_n
        rate = select(slide.normal > 0.0, rate, 0.0)
        change = friction.time_to_friction_change(ground.friction, slide, (a_1, a_2), rate, horizon)
        time = minimum(time, select(touches, change, horizon))
    return time


@compiled
def next_mode_change(
    parts: Parts, state: Table, acceleration: Table, modes: Table, horizon: float
) -> tuple[bool, float]:
    """Updates `modes` (contacts, 12), the contact and friction modes, for a state [q; v]. Returns
    whether a mode changed, and the predicted time (s) to the next change, at most `horizon` (s);
    see time_to_mode_change().

    `parts` is a Model and its Forces. `acceleration` is dv/dt, 6 numbers per body. Also writes
    nodes and ground frames to the Forces.
    """
    robot, forces = unpacked(parts)
    due = modes_after_step(parts, state, modes)
    return due, time_to_mode_change(robot, state, acceleration, modes, forces, horizon)
