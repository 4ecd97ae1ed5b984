"""The clearance of struts, against hand-made pairs and Drake's geometry."""

import numpy as np
import pytest
from pydrake.geometry import (
    Capsule,
    FramePoseVector,
    GeometryFrame,
    GeometryInstance,
    ProximityProperties,
    SceneGraph,
)
from pydrake.math import RigidTransform, RotationMatrix

from tetra_drake.physics.clearance import least_strut_distance, segment_distance
from tetra_drake.physics.kinematics import NODE_COLUMNS, P_WN
from tetra_drake.robot.structure import STRUTS


def nodes_at(p_WN: np.ndarray) -> np.ndarray:
    nodes = np.zeros((len(p_WN), NODE_COLUMNS))
    nodes[:, P_WN : P_WN + 3] = p_WN
    return nodes


@pytest.mark.parametrize(
    ("first", "second", "distance"),
    [
        ([(-1, 0, 0), (1, 0, 0)], [(0, -1, 2), (0, 1, 2)], 2.0),  # they cross
        ([(-1, 0, 0), (1, 0, 0)], [(3, 0, 0), (3, 2, 0)], 2.0),  # end to end
        ([(-1, 0, 0), (1, 0, 0)], [(0, 3, 0), (0, 5, 0)], 3.0),  # an end above a middle
        ([(-1, 0, 0), (1, 0, 0)], [(4, 4, 0), (4, 4, 2)], 5.0),  # beyond both ends
        ([(-1, 0, 0), (1, 0, 0)], [(0.5, 1, 0), (2.5, 1, 0)], 1.0),  # parallel, side by side
        ([(-1, 0, 0), (1, 0, 0)], [(4, 4, 0), (6, 4, 0)], 5.0),  # parallel, apart
        ([(-1, 0, 0), (1, 0, 0)], [(0.5, 0, 0), (2.5, 0, 0)], 0.0),  # on one line
        ([(-1, 0, 0), (1, 0, 0)], [(0, -1, 0), (0, 1, 0)], 0.0),  # they meet
    ],
)
def test_segments_are_as_far_apart_as_their_nearest_points(first, second, distance):
    for turned in (first, first[::-1]):
        for other in (second, second[::-1]):
            nodes = nodes_at(np.array([*turned, *other], dtype=float))
            for pair in ((0, 1, 2, 3), (2, 3, 0, 1)):  # of length 2
                square = segment_distance(nodes, *pair, 1.0 / 4.0)
                assert square == pytest.approx(distance**2, abs=1e-12)


def drake_distance(p_BN: np.ndarray, poses: list[RigidTransform], radius: float) -> float:
    """The least distance between struts of different bodies as Drake finds it: that of capsules,
    and their two radii."""
    scene = SceneGraph()
    source = scene.RegisterSource("robot")
    frames, owner = [], {}
    for i in range(len(poses)):
        frames.append(scene.RegisterFrame(source, GeometryFrame(f"T{i + 1}")))
        for a, b in STRUTS:
            along = p_BN[b] - p_BN[a]
            turn = RotationMatrix.MakeFromOneVector(along, 2)
            pose = RigidTransform(turn, (p_BN[a] + p_BN[b]) / 2)
            shape = Capsule(radius, float(np.linalg.norm(along)))
            strut = GeometryInstance(pose, shape, f"T{i + 1} {a} {b}")
            strut.set_proximity_properties(ProximityProperties())
            owner[scene.RegisterGeometry(source, frames[i], strut)] = i
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


def test_the_clearance_is_that_of_drakes_geometry(structure):
    # The robot as it starts, then bodies that are turned and moved more and more: in the end,
    # they are all over each other, and any strut may be the nearest.
    generator = np.random.default_rng(3)
    for size in [0.0, *np.repeat([0.01, 0.02, 0.04, 0.1], 6)]:
        poses = [
            RigidTransform(
                RotationMatrix.MakeXRotation(30.0 * size * generator.normal())
                @ RotationMatrix.MakeYRotation(30.0 * size * generator.normal())
                @ RotationMatrix.MakeZRotation(30.0 * size * generator.normal()),
                p_WB + size * generator.normal(size=3),
            )
            for p_WB in structure.p_WB
        ]
        p_WN = np.vstack([(pose.multiply(structure.p_BN.T)).T for pose in poses])
        ours = np.sqrt(least_strut_distance(nodes_at(p_WN), np.inf))
        # Within what Drake's iterations for capsules leave; struts that are nearer than two radii
        # overlap, where it is less sure.
        theirs = drake_distance(structure.p_BN, poses, 1e-4)
        assert ours == pytest.approx(theirs, abs=1e-5)


def test_what_is_farther_than_the_least_so_far_changes_nothing(structure):
    p_WN = (structure.p_WB[:, None] + structure.p_BN).reshape(-1, 3)
    least = least_strut_distance(nodes_at(p_WN), np.inf)
    assert least_strut_distance(nodes_at(p_WN), 0.99 * least) == 0.99 * least
    assert least_strut_distance(nodes_at(p_WN), 1.01 * least) == least
