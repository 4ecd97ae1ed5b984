"""A search of one's own: a six-strut robot is wound up and let go so that it jumps far."""

# %% The measured robot: three actuators are wound up in 2 s, then each is let go at its own time.
from pathlib import Path

import cma
import numpy as np
from matplotlib.figure import Figure

import tetra_drake as td
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.command import Command

measured = Path(__file__).parents[2] / "runs" / "measured" / "jump.yaml"
changes = {"simulation.duration": "3.5 s", "simulation.sample_period": "5 ms"}
scenario = td.load_scenario(str(measured)).with_changes(changes)
times, release, unwound, loose = np.arange(0.0, 3.5, 0.002)[:, np.newaxis], 2.5, 0.5816, 0.75


# %% Six numbers from 0 to 1 make a jump: shortenings of up to 30 %, and delays of up to 0.1 s.
def jump(numbers: np.ndarray) -> Command:
    """Free lengths (m) of the actuators."""
    shortening, delay = 0.3 * numbers[:3], 0.1 * numbers[3:]
    wound = unwound * (1.0 - shortening * np.minimum(times / 2.0, 1.0))
    return Command("jump", 0.002, np.where(times < release + delay, wound, loose))


def flights(drawn: list[np.ndarray]) -> list[np.ndarray]:
    """Distance and rise (m) of the centre, from the release to the first touch after the top."""
    paths = []
    for result in td.simulate_many(scenario, [*map(jump, drawn)], record=True):
        assert isinstance(result, SimulationResult)
        motion = result.trajectory.sel(time=slice(release, None))
        x, y, rise = (motion.p_WB.mean("body") - motion.p_WB.mean("body")[0]).values.T
        touches, top = motion.in_contact.any("contact").values, rise.argmax()
        assert touches[top:].any(), "the robot is still in the air at the end"
        paths.append(np.array([np.hypot(x, y), rise])[:, : top + touches[top:].argmax() + 1])
    return paths


# %% CMA-ES makes the landing far. Beside it: jumps with equal shortenings, all let go at once.
generations, most = 40, 1.0  # most: the largest of the numbers
options = {"bounds": [0.0, most], "popsize": 16, "seed": 2, "verbose": -9}
search = cma.CMAEvolutionStrategy(np.full(6, 0.5), 0.25, options)
for _ in range(generations):
    drawn = np.array(search.ask())
    search.tell(drawn, [-path[0, -1] for path in flights([*drawn])])
symmetric = np.linspace(0.5, 1.0, 6)[:, np.newaxis] * [1, 1, 1, 0, 0, 0]
best = {"evolved": flights([search.result.xbest])[0]}
best["symmetric"] = max(flights([*symmetric]), key=lambda path: path[1].max())
axes = (figure := Figure(figsize=(7.0, 3.5), layout="constrained")).subplots()
for name, path in best.items():
    axes.plot(*path, label=f"{name}: {path[0, -1]:.2f} m far, {path[1].max():.2f} m high")
axes.set(xlabel="distance from the start (m)", ylabel="rise of the centre (m)")
axes.legend()
figure.savefig(f"{Path(__file__).stem}.png", dpi=120)
