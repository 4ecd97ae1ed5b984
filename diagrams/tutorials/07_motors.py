"""Motors: can they play a gait, and the files that a prototype needs."""

# %% A gait that was evolved without motors.
import shutil
from pathlib import Path

from matplotlib.figure import Figure

import tetra_drake as td

run = td.load_run(Path(__file__).parents[2] / "runs" / "champion")
gait = run.best_gait()
needs = td.simulate(run.scenario, gait, record=True)
print(f"{needs.metrics.peak_actuator_force:.1f} N, {needs.metrics.peak_actuator_speed:.3f} m/s")

# %% The same gait with motors that have limits and a lag.
motors = run.scenario.with_changes(
    {"actuation": "!TensionMotor {max_force: 21.5 N, max_speed: 401 mm/s, time_constant: 20 ms}"}
)
driven = td.simulate(motors, gait, record=True)
print(f"{needs.metrics.distance_in:.1f} in by forces, {driven.metrics.distance_in:.1f} by motors")

# %% A folder for the lab: commands at 100 Hz, expected positions, loads. Then a simulation of it.
shutil.rmtree("out/lab", ignore_errors=True)
print(td.export(motors, gait, rate=100.0, out="out/lab"))
played = td.simulate(motors, command=td.load_command("out/lab/command.csv", motors))
print(f"played from the file: {played.metrics.distance_in:.1f} in")

# %% The tension of one driven cable, with ideal forces and with motors.
figure = Figure(figsize=(7.0, 3.0), layout="constrained")
axes = figure.subplots()
for name, result in {"forces": needs, "motors": driven}.items():
    tension = result.trajectory.tension.sel(cable="T1-T2 outer bottom_left", time=slice(10.0, 13.0))
    axes.plot(tension.time, tension, label=name)
axes.set(xlabel="time (s)", ylabel="tension (N)")
axes.legend()
figure.savefig(f"{Path(__file__).stem}.png", dpi=120)
