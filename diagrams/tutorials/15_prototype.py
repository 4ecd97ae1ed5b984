"""The loop of a prototype: play a gait, fit the model to the log, evolve again on that."""

# %% A model with fast motors. "The prototype" is MuJoCo with other constants.
from pathlib import Path

from matplotlib.figure import Figure

import tetra_drake as td
from tetra_drake.prototype.command_file import table_text
from tetra_drake.prototype.export import export
from tetra_drake.scenario.scenario import Scenario

settings = {"actuation": "!TensionMotor {max_force: 20 N, max_speed: 1 m/s, time_constant: 20 ms}"}
settings |= {"simulation.duration": "8 s", "simulation.steady_from": "2 s", "optimizer": "!CmaEs"}
numbers = {"friction.stiffness": 0.0, "evolution.trials": 1, "evolution.evaluations": 1000}
model = td.load_scenario("coulomb").with_changes(settings | numbers)
hidden = {"friction.static": 0.35, "friction.kinetic": 0.35, "robot.cables.damping": "7 N*s/m"}
prototype = model.with_changes(hidden | {"engine": "!Mujoco", "actuation": "!Force"})
figure = Figure(figsize=(7.0, 3.0), layout="constrained")


# %% Its motors measure the tension, and follow the command at 100 Hz with a lag of 120 ms.
def play(scenario: Scenario, out: str) -> td.MotionCapture:
    """The log of a gait that is evolved on a scenario, exported and played."""
    run = td.evolve(scenario, out, overwrite=True, reevaluate=False, report=False)
    lab = f"{out}/lab"
    print(export(scenario, run.best_gait(), rate=100.0, out=lab))
    samples, force = td.load_command(f"{lab}/command.csv", scenario).samples, 0.0
    tension, robot = samples[0], td.Simulation(prototype, control_period=2e-3, record=True)
    while not robot.ended.all():
        tension = tension + 2e-3 / 0.12 * (samples[int(100.0 * robot.state.time[0])] - tension)
        force = force + tension - robot.state.tensions[:, robot.robot.driven]
        robot.step(force)
    print(f"the prototype goes {robot.result().metrics.distance_in:.1f} in")
    p_WN = robot.result().trajectory.p_WN
    figure.gca().plot(p_WN.time, 100.0 * p_WN[:, :, 0].mean("node"), label=Path(out).name)
    columns = [f"{node} {axis}_mm" for node in p_WN.node.values for axis in "xyz"]
    log = table_text(columns, p_WN.time.values, 1e3 * p_WN.values.reshape(-1, len(columns)))
    Path(f"{lab}/log.csv").write_text(log, "utf-8")
    return td.MotionCapture(log=f"{lab}/log.csv", command=f"{lab}/command.csv", uncertainty=1e-3)


# %% Fit three constants to the log of the first gait; evolve the next one on the fitted model.
bounds = {"actuation.time_constant": (5e-3, 0.4), "friction.kinetic": (0.1, 0.5)}
bounds |= {"robot.cables.damping": (3.0, 15.0)}
print(fit := td.fit(model, [play(model, "out/first gait")], bounds, search=True))
play(fit.scenario, "out/after the fit")
figure.gca().set(xlabel="time (s)", ylabel="mean x of the nodes (cm)")
figure.gca().legend()
figure.savefig(f"{Path(__file__).stem}.png", dpi=120)
