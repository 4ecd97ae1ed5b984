"""Ground of a scenario as an argument of the compiled kernels: laws, terrain, contact nodes."""

from __future__ import annotations

import numpy as np

from tetra_drake.errors import InputError, check_type, checked_numbers
from tetra_drake.laws import terrain
from tetra_drake.laws.contact import Ground, GroundSection, NormalForce
from tetra_drake.laws.friction import FrictionKind
from tetra_drake.laws.kinematics import NODE_COLUMNS, P_WN
from tetra_drake.laws.terrain import Grid, Relief, fault_of_heights
from tetra_drake.robot.structure import Structure, node_positions
from tetra_drake.scenario.world import World
from tetra_drake.settings.plugins import origin
from tetra_drake.settings.units import INCH

STEP_AHEAD = 1.0 * INCH
"""Distance from the foremost contact node of a robot of usual size to a terrain that begins in
front of it; see Blueprint.scale."""
DEEPEST = 1e-3
"""Largest depth of a node in the ground at the start, as a share of the structure's height."""
START_DEPTH = 1e-6
"""Tolerance (m) for the depth of a foot in the ground at the start, of a robot of usual size. A
foot may also be as deep as the weight would press it, because a robot may start in equilibrium."""


def lift(scenario: World, placed: Structure) -> float:
    """Distance (m) by which a structure must move up so that its lowest foot touches the plane
    z = 0; negative for down.

    `placed` is the structure at the positions of its settings. A foot is the sphere about a contact
    node that touches the ground. The distance is 0 without contact nodes, or if anchors hold a node
    along z. A structure with other anchors is never moved down. Raises InputError if a contact node
    is below the plane by more than a thousandth of the structure's height; if anchors hold the
    structure along z, also if the bottom of a foot is."""
    if not placed.contacts.size:
        return 0.0
    stays, shown, heights = placed.held[:, 2].any(), scenario.units.shown, placed.p_WN[:, 2]
    radius, depths = placed.contact_radius[placed.contacts], -heights[placed.contacts]
    below = radius + depths if stays else depths
    i = below.argmax()
    if below[i] > DEEPEST * (np.ptp(heights) or radius.max()):
        key = f"robot.nodes.{placed.node_names[placed.contacts[i]]}"
        what = f"a foot of radius {shown(radius[i], 'm')}" if stays and radius[i] else "it"
        found = f"{what} starts {shown(below[i], 'm')} below the ground"
        raise InputError(scenario.name, key, f"{found}, expected on it or above")
    lift = 0.0 if stays else float((radius + depths).max())
    return max(0.0, lift) if placed.held.any() else lift


def make_ground(scenario: World, structure: Structure) -> Ground:
    """Ground of a scenario below a structure in its initial pose, as an argument of the compiled
    kernels: laws, heights and contact nodes.

    Raises InputError if the terrain cannot be made, or if the structure starts outside the terrain
    or with a contact node in the ground.
    """
    start = node_positions(structure, structure.initial_state)[structure.contacts]
    fronts = start[:, 0] + structure.contact_radius[structure.contacts]
    ahead = fronts.max(initial=-np.inf) + STEP_AHEAD * structure.scale  # not used without feet
    grid = scenario.terrain.grid(ahead=ahead, scale=structure.scale, source=scenario.name)
    surface = make_surface(scenario.ground, scenario.friction, scenario.terrain, grid)
    made = surface.under(
        structure.contacts,
        carriers=structure.carriers[structure.contacts],
        radius=structure.contact_radius[structure.contacts],
        nodes=len(structure.p_BN),
    )
    if made.flat:
        return made
    near, shown = np.array(grid.corner), scenario.units.shown
    far = near + (np.array(grid.heights.shape) - 1) * grid.cell
    if (start[:, :2] < near).any() or (start[:, :2] > far).any():
        reach = " to ".join(", ".join(shown(x, "m") for x in corner) for corner in (near, far))
        problem = f"the robot starts off its grid, which goes from x, y = {reach}"
        raise InputError(scenario.name, "terrain", problem)
    gaps = foot_gaps(start, made)
    weight = float(structure.mass.sum()) * scenario.robot.gravity
    if gaps.min() < -START_DEPTH * structure.scale - weight / scenario.ground.stiffness:
        node = structure.node_names[structure.contacts[gaps.argmin()]]
        found = f"the robot starts with node {node} {shown(-gaps.min(), 'm')} below the ground"
        raise InputError(scenario.name, "terrain", f"{found}; move what is there, or robot.offsets")
    return made


def make_surface(
    ground: GroundSection,
    friction: FrictionKind,
    terrain_kind: Relief,
    grid: Grid | None = None,
) -> Ground:
    """Ground with the given laws and terrain, but without contact nodes, for AddGroundContact().

    `grid` has the terrain's heights. By default it is made from `terrain_kind`, whose steps or
    obstacles begin at x = 0 if its settings give no start."""
    if grid is None:
        grid = terrain_kind.grid(ahead=0.0, scale=1.0, source="make_surface")
    source = origin(terrain_kind)
    check_type(source, "grid", grid, Grid)
    shape = np.shape(grid.heights)
    heights = checked_numbers(grid.heights, shape, source=source, key="grid.heights")
    checked_numbers(grid.corner, (2,), source=source, key="grid.corner", finite=True)
    cell = checked_numbers(grid.cell, (2,), source=source, key="grid.cell", finite=True)
    fault = fault_of_heights(heights)
    if not fault and cell.min() <= 0.0:
        fault = f"cells of {grid.cell} m"
    if fault:
        raise InputError(source, "grid", f"has {fault}")
    surface_grid = terrain.SurfaceGrid.of(grid, is_stepped=terrain_kind.is_stepped)
    return Ground(
        normal=np.array(NormalForce(ground.stiffness, ground.damping)),
        friction=friction.law(),
        flat=terrain_kind.is_flat,
        grid=np.array(surface_grid),
        heights=heights.ravel(),
    )


def ground_heights(x_y: np.ndarray, ground: Ground) -> np.ndarray:
    """Heights (...) of the surface, z in the world, at the horizontal positions `x_y` (..., 2); all
    in m."""
    top = np.full((x_y.size // 2, 1), terrain.SurfaceGrid(*ground.grid).top)
    frames = ground_frames(np.hstack([x_y.reshape(-1, 2), top]), ground)
    return (top[:, 0] - frames[:, terrain.GAP] / frames[:, terrain.N_Z]).reshape(x_y.shape[:-1])


def ground_axes(p_WN: np.ndarray, ground: Ground) -> np.ndarray:
    """Axes of the surface below the points p_WN (points, 3) in m: an array (points, 3, 3) whose
    rows are the tangents t1 and t2 and the normal n at each point; see laws.terrain."""
    frames = ground_frames(p_WN, ground)
    axes = np.zeros((len(p_WN), 3, 3))
    axes[:, 0] = frames[:, terrain.T1_X : terrain.T1_Z + 1]
    axes[:, 1, 1:] = frames[:, terrain.T2_Y : terrain.T2_Z + 1]
    axes[:, 2] = frames[:, terrain.N_X : terrain.N_Z + 1]
    return axes


def foot_gaps(p_WN: np.ndarray, ground: Ground) -> np.ndarray:
    """Distances (contacts,) in m of feet with the centres p_WN (contacts, 3) from the surface;
    negative in the ground."""
    frames = ground_frames(p_WN, ground)
    frames[:, terrain.GAP] -= ground.radius
    for i in np.flatnonzero(ground.radius[: len(ground.rolled)]).tolist():
        grid = terrain.SurfaceGrid(*ground.rolled[i])
        terrain.put_frame(tuple(p_WN[i]), grid, ground.heights, True, i, frames)
    return frames[:, terrain.GAP]


def ground_frames(p_WN: np.ndarray, ground: Ground) -> np.ndarray:
    """Table `frames` of laws.terrain (points, FRAME_COLUMNS) for the points p_WN (points, 3) in m:
    a row has the point's distance (m) from the surface, positive above it, and the axes of the
    surface there."""
    frames = np.empty((len(p_WN), terrain.FRAME_COLUMNS))
    nodes = np.zeros((len(p_WN), NODE_COLUMNS))
    nodes[:, P_WN : P_WN + 3] = p_WN
    grid = terrain.SurfaceGrid(*ground.grid)
    terrain.find_frames(nodes, np.arange(len(p_WN)), grid, ground.heights, frames)
    return frames
