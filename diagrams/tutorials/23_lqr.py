"""LQR: a guyed mast is linearized, and a regulator holds it against pushes that topple it."""

# %% A mast on a ball joint, with a mass at its top. Three soft guys with actuators hold it.
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import tetra_drake as td
from tetra_drake.engines.drake import MakeSimulator
from tetra_drake.robot.structure import node_positions
from tetra_drake.scenario.engine_kinds import Drake
from tetra_drake.systems import SampledController
from tetra_drake.systems.diagram import MakeTensegrityDiagram

structure = Path(__file__).parent / "guyed_mast.yaml"
scenario = td.load_scenario("prism").with_changes(
    {
        "name": "guyed mast",
        "robot": f"!Structure {{file: {structure}}}",
        "terrain": "!Nothing {}",
        "simulation.duration": "4 s",
        "simulation.control_period": "20 ms",
    }
)

# %% Its small motions about rest, as Drake's LinearSystem. It sways slowly, with little damping.
linear = td.linearize(scenario)
modes = linear.modes()
print(f"sways at {modes.frequencies[0]:.2f} Hz, damping ratio {modes.damping_ratios[0]:.2f}")

# %% Leaning by 1 rad costs as much as three tensions of 18 N beyond rest.
cost = np.diag([float(name.endswith(("theta_x", "theta_y"))) for name in linear.states])
gain = linear.lqr(cost, 1e-3 * np.eye(3))
hold = linear.controller(gain)

# %% The same push on Drake's diagram. The regulator is a system in it.
regulator = SampledController(linear.robot, hold, period=0.02)
diagram = MakeTensegrityDiagram(linear.robot, controller=regulator)
simulator = MakeSimulator(diagram, linear.robot, Drake())
plant, context = diagram.GetSubsystemByName("plant"), simulator.get_mutable_context()
push, middle = np.array([0.0, 2.0, 0.0]), linear.robot.structure.p_WB[0]
own = plant.GetMyContextFromRoot(context)
plant.SetVelocities(own, np.concatenate([push, np.cross(push, middle)]))
top = linear.robot.structure.node_names.index("top")
for time in (0.25, 0.5, 1.0, 2.0):
    simulator.AdvanceTo(time)
    state = diagram.GetOutputPort("state").Eval(simulator.get_context())
    x = node_positions(linear.robot.structure, state)[top, 0]
    print(f"after {time} s, the top is {100.0 * x:.1f} cm aside")

# %% Robots side by side on the compiled engine, each pushed at another speed of its top, in one of
# twelve directions. A robot is held if its top stays above its foot.
directions, speeds = np.radians(np.arange(0.0, 360.0, 30.0)), np.arange(0.25, 5.0, 0.25)
pushes = [(direction, speed) for direction in directions for speed in speeds]


def held(regulated: bool) -> np.ndarray:
    """Greatest speed (m/s) in each direction up to which all pushes are held."""
    robots = td.Simulation(scenario, count=len(pushes))
    readings, stands = robots.step(robots.rest), np.ones(len(pushes), dtype=bool)
    for number, (direction, speed) in enumerate(pushes):
        pushed = readings.rows(number).copied()
        spin = speed * np.array([-np.sin(direction), np.cos(direction), 0.0])
        pushed.w_WB[:], pushed.v_WN[:2] = spin, np.cross(spin, pushed.p_WN[:2])
        robots.assume(pushed, place=number)
    readings, actions = robots.state, robots.rest.copy()
    while not robots.ended[stands].all():
        for place in np.flatnonzero(stands).tolist() if regulated else []:
            actions[place] = hold(0.0, readings.rows(place))
        readings = robots.step(actions, indices=np.flatnonzero(stands))
        stands &= readings.p_WN[:, top, 2] > 0.0
    first = np.cumprod(stands.reshape(len(directions), len(speeds)), axis=1).sum(axis=1)
    return np.concatenate([[0.0], speeds])[first]


# %% The regions of pushes that are held, in m/s. The guys pull at 0, 120 and 240 degrees.
regions = {"guys alone": held(False), "with LQR": held(True)}
print(f"{'direction (deg)':18}" + "".join(f"{angle:6.0f}" for angle in np.degrees(directions)))
figure = Figure(figsize=(4.5, 4.0), layout="constrained")
axes = figure.add_subplot(projection="polar")
for name, region in regions.items():
    print(f"{name:18}" + "".join(f"{speed:6.2f}" for speed in region))
    axes.fill(directions, region, alpha=0.5, label=name)
axes.set_title("pushes that are held: speed of the top (m/s)", fontsize=10)
axes.legend(loc="lower left", bbox_to_anchor=(-0.1, -0.1))
figure.savefig(f"{Path(__file__).stem}.png", dpi=120)
