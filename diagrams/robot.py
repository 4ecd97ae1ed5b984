"""Diagram of the robot: builds it, simulates one gait, writes a page that shows the motion.

    python diagrams/robot.py [GAIT.json]

    cpg ──→ start_up ──→ cables ──┬──→ forces ──→ plant ──┬──→ state
                           ↑      │                       │
                           │    ground                    │
                           │      ↑                       │
                           └──────┴───────────────────────┘

cpg       MatsuokaCpg: four oscillators, whose neurons are continuous state
start_up  StartUpGate: zeros until 1.25 s, then the signals
cables    CableNetwork: the tension of 24 cables, from their length, its rate, and the signals
ground    GroundContact: normal force and friction at 11 nodes; contact and stiction are discrete
          state
plant     MultibodyPlant: five tetrahedra, free bodies without joints and contact geometry

The wiring is tetra_drake/systems/diagram.py. Writes robot.svg, the block diagram, and robot.html,
the page. `tetra-drake simulate` takes longer steps. They end at predicted mode changes, where a
node touches the ground or breaks free.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from block_diagram import OUT, save_block_diagram
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator

from tetra_drake.engines.sampler import Sampler
from tetra_drake.evolution.run import load_run
from tetra_drake.results.trajectory import make_dataset, sample_times
from tetra_drake.robot.gait_file import load_gait
from tetra_drake.robot.measures import distance_walked
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import load_scenario
from tetra_drake.systems.diagram import MakeTensegrityDiagram
from tetra_drake.visualization.replay import Replay

RUN = Path(__file__).parents[1] / "runs" / "thesis"
"""A run whose best gait is the default."""


def main(gait_file: Path | None = None, *, duration: float = 15.0, out: Path = OUT) -> None:
    """Simulates the beginning of a gait and writes the pictures."""
    scenario = load_scenario("thesis")
    gait = load_run(RUN).best_gait() if gait_file is None else load_gait(gait_file, scenario)
    robot = Robot.of(scenario)
    diagram = MakeTensegrityDiagram(robot, gait)
    save_block_diagram(diagram, out / "robot.svg")

    # Contact and stiction change at the end of a step, so steps must be short.
    simulator, max_step = Simulator(diagram), 0.001
    ResetIntegratorFromFlags(simulator, "runge_kutta3", max_step)
    sampler = Sampler(diagram, sample_times(duration, 0.01), max_step=max_step)
    simulator.set_monitor(sampler.after_step)
    simulator.AdvanceTo(duration)

    trajectory = make_dataset(robot, sampler.motion())
    walked = scenario.units.shown(distance_walked(trajectory, robot.structure)[-1], "m")
    title = f"{gait.name}: {walked} in {duration:g} s"
    Replay(robot, trajectory, title).save(out / "robot.html")
    print(title)
    print(f"open {out / 'robot.html'} in a browser to see it walk")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("gait_file", nargs="?", type=Path)
    main(parser.parse_args().gait_file)
