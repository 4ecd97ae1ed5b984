"""Engine `compiled`: the same equations without Drake, with several gaits side by side in lanes."""

from __future__ import annotations

from collections.abc import Sequence

from tetra_drake.engines.engine import Engine, Outcome, outcome_of
from tetra_drake.engines.gait_simulation import Driver, GaitSimulation
from tetra_drake.engines.lanes.lane_engine import BODY_STEPS, LaneEngine
from tetra_drake.engines.lanes.lane_pool import LanePool
from tetra_drake.engines.lanes.lane_stepper import LaneStepper
from tetra_drake.engines.lanes.prepared import Prepared
from tetra_drake.engines.time_limit import check_time
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.gait import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.scenario import Scenario


class CompiledEngine(Engine):
    """Engine that simulates in compiled kernels. Other Python threads run meanwhile."""

    lane_pool = LanePool

    def prepare(self, scenario: Scenario) -> None:
        simulation = GaitSimulation(Robot.of(scenario), seeded_gait(scenario))
        LaneEngine(Prepared.of(simulation))

    def simulate(self, simulation: GaitSimulation) -> SimulationResult:
        prepared = Prepared.of(simulation)
        engine = LaneEngine(prepared)
        engine.load(0, prepared)
        while not engine.advance(BODY_STEPS):
            check_time()
        return engine.result(0)

    def stepper(self, first: GaitSimulation, *, count: int, threads: int) -> LaneStepper:
        return LaneStepper(first, count=count, threads=threads)

    def simulate_many(
        self, simulations: Sequence[tuple[Scenario, Driver]], *, record: bool, threads: int
    ) -> list[Outcome]:
        with LanePool(threads) as pool:
            futures = pool.submit(simulations, record=record)
            return [outcome_of(future.result) for future in futures]


ENGINE = CompiledEngine()
