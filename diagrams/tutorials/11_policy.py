"""A policy: forces by a clock and by what the robot senses, evolved by CMA-ES on many robots."""

# %% Robots with Coulomb friction, side by side on the compiled engine. Actions are forces.
from pathlib import Path

import cma
import numpy as np
from matplotlib.figure import Figure

import tetra_drake as td

generations, most = 120, 2.0  # most: the largest force in N
changes = {"simulation.duration": "5 s", "simulation.steady_from": "1 s"}
robots = td.Simulation(td.load_scenario("coulomb").with_changes(changes), count=48)
driven, start = robots.robot.driven, robots.state


# %% A linear policy: the clock, and for the policy with senses also lengths and loads.
def walk(gains: np.ndarray) -> np.ndarray:
    """Ways along x (N, steps) in m of robots with the gains (N, cables, inputs)."""
    state, ways = robots.reset(), []
    while not robots.ended.all():
        clock = 2.0 * np.pi * 0.7 * state.time[:, np.newaxis]
        lengths = 30.0 * (state.lengths - start.lengths)[:, driven]
        inputs = np.hstack([np.sin(clock), np.cos(clock), lengths, state.normal_forces])
        forces = np.einsum("nai,ni->na", gains, inputs[:, : gains.shape[2]])
        state = robots.step(np.clip(forces, -most, most))
        ways.append((state.p_WN - start.p_WN)[..., 0].mean(axis=1))
    return np.array(ways).T


figure = Figure(figsize=(7.0, 3.0), layout="constrained")
axes = figure.subplots()
for name, inputs in {"clock alone": 2, "clock and senses": 2 + driven.size + 11}.items():
    size = driven.size * inputs
    search = cma.CMAEvolutionStrategy(
        np.zeros(size), 0.3, {"popsize": 48, "seed": 1, "verbose": -9}
    )
    for _ in range(generations):
        drawn = np.array(search.ask())
        search.tell(drawn, -walk(drawn.reshape(48, driven.size, inputs))[:, -1])
    way = walk(np.tile(search.result.xbest, (48, 1)).reshape(48, driven.size, inputs))[0]
    print(f"{name}: {way[-1] / 0.0254:.1f} in")
    axes.plot(0.02 * np.arange(1, 1 + way.size), 100.0 * way, label=name)
axes.set(xlabel="time (s)", ylabel="way (cm)")
axes.legend()
figure.savefig(f"{Path(__file__).stem}.png", dpi=120)
