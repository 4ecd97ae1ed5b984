"""The experiment on one screen: an evolutionary search that builds a Drake diagram per candidate.

    python diagrams/evolution.py [EVALUATIONS]

A candidate is a vector: weights and time constants. evolution.html shows the best one walking.
"""

import argparse

import numpy as np
from block_diagram import OUT

import tetra_drake as td
from tetra_drake.engines.drake import MakeSimulator
from tetra_drake.optimizers import Evaluation, optimizer_of
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.engine_kinds import Drake
from tetra_drake.systems.diagram import MakeTensegrityDiagram

SCENARIO, X = td.load_scenario("quick"), 4  # the rear tetrahedron's x in the state [q; v]


def distance(robot: Robot, gait: Gait) -> float:
    """Way (m) of a gait: cables, ground and MatsuokaCpg around a plant, with error control."""
    diagram = MakeTensegrityDiagram(robot, gait)
    simulator = MakeSimulator(diagram, robot, Drake())
    simulator.AdvanceTo(SCENARIO.simulation.duration)
    state = diagram.GetOutputPort("state").Eval(simulator.get_context())
    return float(state[X] - robot.structure.initial_state[X])


def main(evaluations: int = 28) -> None:
    """Searches, prints each generation and writes the page."""
    robot, space = Robot.of(SCENARIO), td.ParameterSpace.of(SCENARIO)
    gaits, ways = list[Gait](), list[float]()
    search = optimizer_of(SCENARIO.optimizer)(space, SCENARIO.evolution, np.random.default_rng(0))
    while len(ways) < evaluations:
        asked = [space.gait(vector, name="evolved") for vector in search.ask()]
        found = [distance(robot, gait) for gait in asked]
        search.tell([Evaluation(fitness=way) for way in found])
        gaits, ways = gaits + asked, ways + found
        print(f"{len(ways)} gaits, the best {max(ways):.3f} m", flush=True)
    td.simulate(SCENARIO, gaits[np.argmax(ways)], record=True).save_replay(OUT / "evolution.html")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("evaluations", nargs="?", type=int, default=28)
    main(**vars(parser.parse_args()))
