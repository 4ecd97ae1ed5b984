"""The clearance of struts, against hand-made pairs and Drake's geometry."""

import numpy as np
import pytest
from helpers.states import disturbed, strut_clearance
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import (
    Capsule,
    FramePoseVector,
    GeometryFrame,
    GeometryInstance,
    ProximityProperties,
    SceneGraph,
)
from pydrake.math import RigidTransform, RotationMatrix

from tetra_drake.laws.kinematics import NODE_COLUMNS, P_WN
from tetra_drake.laws.struts import Struts, strut_distance
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import Structure
from tetra_drake.scenario.load import load_scenario

PAIR = Struts(
    *map(np.array, ([0, 2], [1, 3], [0, 2], [1, 3], [0, 1, 2])),
    length=np.full(2, 2.0),
    radius=np.full(2, 0.1),
)
"""Two struts of length 2, of two bodies."""


SEGMENTS = [([(-1, 0, 0), (1, 0, 0)], [(0, -1, 2), (0, 1, 2)], 2.0)]  # they cross
SEGMENTS += [([(-1, 0, 0), (1, 0, 0)], [(0.5, 1, 0), (2.5, 1, 0)], 1.0)]  # parallel, side by side
SEGMENTS += [([(-1, 0, 0), (1, 0, 0)], [(0.5, 0, 0), (2.5, 0, 0)], 0.0)]  # on one line
SEGMENTS += [([(-1, 0, 0), (1, 0, 0)], [(0, -1, 0), (0, 1, 0)], 0.0)]  # they meet


@pytest.mark.parametrize(("first", "second", "distance"), SEGMENTS)
def test_segments_are_as_far_apart_as_their_nearest_points(first, second, distance):
    for ends in ([*first, *second], [*first[::-1], *second], [*first, *second[::-1]]):
        nodes = np.zeros((4, NODE_COLUMNS))
        nodes[:, P_WN : P_WN + 3] = ends
        for pair in ((0, 1), (1, 0)):
            assert strut_distance(PAIR, nodes, *pair) == pytest.approx(distance, abs=1e-12)


def drake_distance(structure: Structure, poses: list[RigidTransform], radius: float) -> float:
    """The least distance between struts of different bodies as Drake finds it: that of capsules,
    and their two radii."""
    scene = SceneGraph()
    source = scene.RegisterSource("robot")
    frames = [scene.RegisterFrame(source, GeometryFrame(name)) for name in structure.bodies]
    owner = {}
    for a, b in structure.struts:
        start, end = structure.p_BN[a], structure.p_BN[b]
        turn = RotationMatrix.MakeFromOneVector(end - start, 2)
        shape = Capsule(radius, float(np.linalg.norm(end - start)))
        strut = GeometryInstance(RigidTransform(turn, (start + end) / 2), shape, f"{a} {b}")
        strut.set_proximity_properties(ProximityProperties())
        body = structure.carriers[a]
        owner[scene.RegisterGeometry(source, frames[body], strut)] = body
    context = scene.CreateDefaultContext()
    vector = FramePoseVector()
    for frame, pose in zip(frames, poses, strict=True):
        vector.set_value(frame, pose)
    scene.get_source_pose_port(source).FixValue(context, vector)
    query = scene.get_query_output_port().Eval(context)
    return min(
        query.ComputeSignedDistancePairClosestPoints(x, y).distance + 2.0 * radius
        for x in owner
        for y in owner
        if owner[x] < owner[y]
    )


@pytest.mark.parametrize("name", ["thesis", "six_bar", "mast"])
def test_the_clearance_is_that_of_drakes_geometry(name):
    # The robot as it starts, then bodies that are turned and moved more and more: in the end,
    # they are all over each other, and any strut may be the nearest.
    robot, generator = Robot.of(load_scenario(name)), np.random.default_rng(3)
    structure = robot.structure
    for size in [0.0, *np.repeat([0.01, 0.02, 0.04, 0.1], 3)]:
        state = disturbed(structure, int(generator.integers(1000)), pose=size, speed=0.0)
        poses = [
            RigidTransform(Quaternion(pose[:4]), pose[4:])
            for pose in state[: 7 * len(structure.bodies)].reshape(-1, 7)
        ]
        # Within what Drake's iterations for capsules leave; struts that are nearer than two radii
        # overlap, where it is less sure.
        theirs = drake_distance(structure, poses, 1e-4)
        assert strut_clearance(robot, state) == pytest.approx(theirs, abs=1e-5)


def test_what_is_farther_than_the_least_so_far_changes_nothing(robot):
    state = robot.structure.initial_state
    least = strut_clearance(robot, state)
    assert strut_clearance(robot, state, 0.99 * least) == 0.99 * least
    assert strut_clearance(robot, state, 1.01 * least) == least
