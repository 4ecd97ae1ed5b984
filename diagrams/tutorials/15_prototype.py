"""The loop of a prototype: play a gait, fit the model to the log, evolve again on that."""

# %% A model with fast motors. "The prototype" is MuJoCo with other constants, slow motors for one.
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import tetra_drake as td
from tetra_drake.robot.command_file import table_text
from tetra_drake.scenario.scenario import Scenario

settings = {"actuation": "!TensionMotor {max_force: 20 N, max_speed: 1 m/s, time_constant: 20 ms}"}
settings |= {"simulation.duration": "8 s", "simulation.steady_from": "2 s", "optimizer": "!CmaEs"}
numbers = {"friction.stiffness": 0.0, "evolution.trials": 1, "evolution.evaluations": 1000}
model = td.load_scenario("coulomb").with_changes(settings | numbers)
hidden = {"friction.static": 0.35, "friction.kinetic": 0.35, "robot.cables.damping": "7 N*s/m"}
hidden |= {"actuation.time_constant": "0.2 s", "engine": "!Mujoco"}
prototype = model.with_changes(hidden)
figure = Figure(figsize=(7.0, 3.0), layout="constrained")
axes = figure.subplots()


# %% The command of a gait goes to the prototype. Cameras see it within half a millimetre.
def play(scenario: Scenario, out: str, color: str) -> td.MotionCapture:
    """The log of a gait that is evolved on a scenario: of its first 3 s, as differences grow."""
    run = td.evolve(scenario, out, overwrite=True, reevaluate=False, report=False)
    lab = f"{out}/lab"
    print(td.export(scenario, run.best_gait(), rate=100.0, out=lab))
    command = td.load_command(f"{lab}/command.csv", scenario)
    for robot, who, width in (scenario, "model", 1.0), (prototype, "prototype", 4.0):
        result = td.simulate(robot, command=command, record=True)
        print(f"{out}: the {who} goes {result.metrics.distance_in:.1f} in")
        x = 100.0 * result.trajectory.p_WN[:, :, 0].mean("node")
        label = f"{Path(out).name}, {who}"
        axes.plot(x.time, x, color=color, linewidth=width, alpha=0.5, label=label)
    p_WN = result.trajectory.p_WN.sel(time=slice(0.0, 3.0))
    seen = p_WN.values + np.random.default_rng(0).normal(scale=5e-4, size=p_WN.shape)
    columns = [f"{node} {axis}_mm" for node in p_WN.node.values for axis in "xyz"]
    log = table_text(columns, p_WN.time.values, 1e3 * seen.reshape(len(seen), -1))
    Path(f"{lab}/log.csv").write_text(log, "utf-8")
    return td.MotionCapture(log=f"{lab}/log.csv", command=f"{lab}/command.csv", uncertainty=5e-4)


# %% Fit three constants to the log of the first gait; evolve the next one on the fitted model.
bounds = {"actuation.time_constant": (5e-3, 0.4), "robot.cables.damping": (3.0, 15.0)}
bounds |= {"friction.static, friction.kinetic": (0.1, 0.6)}  # one value of both
log = play(model, "out/before the fit", "C0")
print(fit := td.fit(model.with_changes({"simulation.duration": "3 s"}), [log], bounds))
play(fit.scenario.with_changes({"simulation.duration": "8 s"}), "out/after the fit", "C1")
axes.set(xlabel="time (s)", ylabel="mean x of the nodes (cm)")
axes.legend()
figure.savefig(f"{Path(__file__).stem}.png", dpi=120)
