"""The compiled engine's memory: loads a gait into a SIMD lane, runs it, and reads its course."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numba import typeof
from numba.core import registry

from tetra_drake.engines.compiled.block_tridiagonal import BLOCK, ROW
from tetra_drake.engines.compiled.dynamics import Forces
from tetra_drake.engines.compiled.loop import (
    CLOCK_ROWS,
    DUE,
    EVALUATIONS,
    IDLE,
    MARK,
    ROUND,
    STATUS,
    STEP,
    TAKEN,
    TIME,
    TRIED,
    WALKING,
    LaneTables,
    Log,
    advance,
)
from tetra_drake.engines.compiled.rosenbrock import Step
from tetra_drake.errors import MAX_SPEED
from tetra_drake.physics.cable import PULL_COLUMNS, Cables
from tetra_drake.physics.contact import MODE_COLUMNS, Ground, Law
from tetra_drake.physics.feedback import Senses
from tetra_drake.physics.kinematics import NODE_COLUMNS
from tetra_drake.physics.model import JUNCTION_CABLES, Body, Model
from tetra_drake.physics.oscillator import NEURON_COLUMNS, Network, make_neurons
from tetra_drake.physics.tally import Tally
from tetra_drake.physics.terrain import FRAME_COLUMNS
from tetra_drake.results.metrics import empty_tally
from tetra_drake.results.result import motion_times
from tetra_drake.results.trajectory import Motion
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.robot import Robot, SteeringSignal, initial_neurons
from tetra_drake.robot.signals import sample_count
from tetra_drake.scenario.engine_kinds import Compiled
from tetra_drake.simd.lanes import FieldArray, lane_table

_INDICES = 3  # the first fields of Senses, which lanes share


@dataclass(frozen=True)
class PreparedGait:
    """A gait on a scenario, prepared for a lane."""

    robot: Robot
    gait: Gait
    record: bool
    steering: SteeringSignal | None
    """In place of the gait's turn."""
    times: np.ndarray
    """The times (s) of the samples to keep, those of motion_times()."""
    marks: np.ndarray
    """The times (s) at which steps end."""

    @classmethod
    def of(
        cls,
        robot: Robot,
        gait: Gait,
        *,
        record: bool,
        steering: SteeringSignal | None = None,
    ) -> PreparedGait:
        """Prepares a gait."""
        simulation, start_up = robot.scenario.simulation, robot.scenario.cpg.start_up
        ends = 0.0, simulation.steady_from, simulation.duration
        return cls(
            robot,
            gait,
            record,
            steering,
            times=motion_times(simulation, record=record),
            marks=np.unique([*ends, *([start_up] if start_up <= simulation.duration else [])]),
        )

    @property
    def kind(self) -> tuple[object, ...]:
        """What simulations that share an engine must have in common."""
        scenario, ground = self.robot.scenario, self.robot.ground
        drivers = tuple(self.robot.actuation.drivers.tolist())
        return (
            scenario.robot.tetrahedra,
            len(ground.contacts),
            scenario.cables.slack,
            drivers,
            self.live,
            ground.flat,
            ground.coulomb,
        )

    @property
    def live(self) -> bool:
        """Whether the network is integrated with the robot."""
        return self.robot.scenario.cpg.signals == "live"

    @property
    def recent_signals(self) -> int:
        """How many samples of the signals an engine has to hold: those within a step, and as many
        for lanes that run ahead; a power of two."""
        scenario = self.robot.scenario
        within = scenario.settings_of(Compiled).max_step / scenario.cpg.listing_step
        return 1 << math.ceil(math.log2(2.0 * within + 32.0))

    @property
    def turn_samples(self) -> int:
        """How many samples of the turn an engine has to hold."""
        if self.steering is None:
            return 1
        scenario = self.robot.scenario
        return round(scenario.simulation.duration / scenario.cpg.listing_step) + 1


class Course(NamedTuple):
    """The course of a simulation."""

    status: int
    time: float
    """When it ended, in s."""
    steps: int
    evaluations: int
    motion: Motion
    totals: Tally
    wall_time: float
    """What it cost, in s: shared with the other lanes of the same core."""


class LaneEngine:
    """Simulates gaits of one kind in `width` lanes."""

    def __init__(self, first: PreparedGait, *, width: int) -> None:
        """For gaits like the first; see `accepts`. Compiles the engine where that is not done."""
        self._kind = first.kind
        model, self._model_tables = _lane_model(first.robot.model, width)
        self._heights = model.ground.heights.array.reshape(width, -1)
        self._tables = _zeros(first.robot, model, width)
        structure = first.robot.structure
        self._bodies = len(structure.bodies)
        shape, signals = (width, len(first.times)), structure.signals
        self._log = Log(
            marks=np.full((width, 5), math.inf),
            passed=np.zeros(width, dtype=np.int64),
            times=np.full((width, len(first.times) + 1), math.inf),
            kept=np.zeros(width, dtype=np.int64),
            states=np.zeros((*shape, structure.initial_state.size)),
            modes=np.zeros((*shape, len(structure.contacts), MODE_COLUMNS)),
            signals=np.zeros((*shape, signals)),
            recent=np.zeros((width, first.recent_signals, signals)),
            turns=np.zeros((width, first.turn_samples)),
        )
        log = Log(*(FieldArray(array, any_size=True) for array in self._log))
        self._arguments = self._tables, log, first.live
        # Called without looking for the types of all these tables each time.
        kinds = tuple(typeof(each) for each in (*self._arguments, 0))
        self._advance = advance.compile(kinds)  # type: ignore[attr-defined]
        self._in_lane: list[PreparedGait | None] = [None] * width
        self._wall_times = [0.0] * width
        for lane in range(width):  # so that idle lanes compute with proper numbers
            self.load(lane, first)
            self.stop(lane)

    def accepts(self, prepared: PreparedGait) -> bool:
        """Whether a gait can be simulated: one like the first in structure and kind of signals,
        and with no more to keep."""
        log = self._log
        return (
            prepared.kind == self._kind
            and len(prepared.times) < log.times.shape[1]
            and prepared.recent_signals <= log.recent.shape[1]
            and prepared.turn_samples <= log.turns.shape[1]
            and prepared.robot.ground.heights.size <= self._heights.shape[1]
        )

    @property
    def idle(self) -> list[int]:
        """The lanes without a gait."""
        return [lane for lane, prepared in enumerate(self._in_lane) if prepared is None]

    def load(self, lane: int, prepared: PreparedGait) -> None:
        """Starts a gait in a lane; raises InputError if it does not fit its scenario."""
        robot, gait = prepared.robot, prepared.gait
        scenario, model, structure = robot.scenario, robot.model, robot.structure
        start, modes = structure.initial_state, robot.starting_modes()
        cpg, simulation = scenario.cpg, scenario.simulation
        network, senses = robot.network(gait), robot.senses
        turns = robot.turns(gait, prepared.steering)
        engine = scenario.settings_of(Compiled)
        numbers: dict[str, Any] = dict(engine)
        numbers |= {"max_speed": MAX_SPEED, "max_evaluations": simulation.max_evaluations}
        numbers |= {"gain": cpg.gain, "period": cpg.listing_step, "samples": sample_count(scenario)}
        numbers |= {"start_up": cpg.start_up, "signals": 0.0, "modes": modes}
        numbers["neurons"] = make_neurons(initial_neurons(cpg, scenario.oscillators))
        numbers["external_input"] = cpg.external_input
        numbers["gains"] = [gain for _, gain in gait.gains]
        numbers["sides"] = np.repeat(structure.actuation.sides, 2)
        numbers["tonic"] = robot.tonic_input(turns)[0]
        for name, values in numbers.items():
            getattr(self._tables, name).array[..., lane] = values
        for table, value in zip(self._tables.tally, empty_tally(scenario), strict=True):
            table.array[..., lane] = value
        first, beyond, *tables = self._tables.network
        first.array[:] = np.minimum(first.array, network.first)  # so that they hold for all lanes
        beyond.array[:] = np.maximum(beyond.array, network.beyond)
        tables += [*self._model_tables, *self._tables.senses[_INDICES:]]
        constants = *network[2:], *_numbers(model), *senses[_INDICES:]
        for table, values in zip(tables, constants, strict=True):
            table.array[..., lane] = values
        heights = self._heights[lane]
        heights[: model.ground.heights.size] = model.ground.heights
        self._tables.robot.ground.law.first.array[0, lane] = lane * heights.size
        self._tables.step.state.array[:, lane] = start

        log, clock = self._log, self._tables.clock.array
        log.times[lane] = log.marks[lane] = math.inf
        log.times[lane, : len(prepared.times)] = prepared.times
        log.marks[lane, : len(prepared.marks)] = prepared.marks
        log.turns[lane], log.turns[lane, : len(turns)] = turns[-1], turns
        log.states[lane, 0], log.modes[lane, 0], log.signals[lane, 0] = start, modes, 0.0
        log.kept[lane], log.passed[lane] = 1, 0
        clock[:, lane] = 0.0
        first_step = min(engine.look_ahead, engine.max_step)
        clock[STATUS, lane], clock[STEP, lane] = WALKING, first_step
        clock[MARK, lane], clock[DUE, lane] = log.marks[lane, 0], log.times[lane, 1]
        self._in_lane[lane], self._wall_times[lane] = prepared, 0.0

    def stop(self, lane: int) -> float:
        """Takes the gait out of a lane, wherever it is; returns what it cost, in s."""
        self._in_lane[lane] = None
        self._tables.clock.array[STATUS, lane] = IDLE
        return self._wall_times[lane]

    def advance(self, body_steps: int) -> list[tuple[int, PreparedGait, Course]]:
        """Simulates until one of the lanes ends, or for about so many iterations times bodies;
        returns lanes and gaits that have ended, which are idle then. Other threads run meanwhile.
        """
        started = time.perf_counter()
        self._advance(*self._arguments, max(1, body_steps // (ROUND * self._bodies)))
        busy = [(lane, gait) for lane, gait in enumerate(self._in_lane) if gait is not None]
        share = (time.perf_counter() - started) / max(len(busy), 1)
        ended = []
        for lane, prepared in busy:
            self._wall_times[lane] += share
            if self._tables.clock.array[STATUS, lane] != WALKING:
                ended.append((lane, prepared, self._course(lane)))
                self.stop(lane)
        return ended

    def _course(self, lane: int) -> Course:
        clock, log = self._tables.clock.array[:, lane], self._log
        kept = slice(log.kept[lane])
        return Course(
            status=int(clock[STATUS]),
            time=float(clock[TIME]),
            steps=int(clock[TAKEN]),
            evaluations=EVALUATIONS * int(clock[TRIED]),
            motion=Motion(
                times=log.times[lane, kept].copy(),
                states=log.states[lane, kept].copy(),
                signals=log.signals[lane, kept].copy(),
                modes=log.modes[lane, kept].copy(),
            ),
            totals=Tally(*(t.array[..., lane].copy() for t in self._tables.tally)),
            wall_time=self._wall_times[lane],
        )


def lanes_for(gaits: float) -> int:
    """The number of lanes in which so many gaits are simulated fastest on a core of this machine;
    their numbers are the same with any.

    Eight doubles fill a register of AVX-512. With narrower registers, eight lanes need more of
    them than there are, and four are faster.
    """
    if gaits <= 1:
        return 1
    return 8 if gaits > 4 and "+avx512f" in processor_features() else 4


def processor_features() -> str:
    """The instructions that numba compiles for, such as +avx2: its settings', or the machine's."""
    return registry.cpu_target.target_context.codegen().magic_tuple()[2]


def _numbers(model: Model) -> list[np.ndarray]:
    """The arrays of a model that differ between scenarios, in the order of its lane tables."""
    cables = [model.cables[name] for name in Cables._fields[3:]]
    law = [model.ground.law[name] for name in Law._fields]
    return [model.p_BN, *cables, *law, *model.body]


def _lane_model(model: Model, width: int) -> tuple[Model, list[FieldArray]]:
    """The model in lanes, and those of its tables that differ between scenarios."""
    tables = [lane_table(values.shape, width) for values in _numbers(model)]
    rest = iter(tables)
    p_BN = next(rest)
    indices = [FieldArray(model.cables[name].copy()) for name in Cables._fields[:3]]
    lanes = Model(
        p_BN=p_BN,
        cables=Cables(*indices, *(next(rest) for _ in Cables._fields[3:])),
        ground=Ground(
            contacts=FieldArray(model.ground.contacts.copy()),
            law=Law(*(next(rest) for _ in Law._fields)),  # type: ignore[arg-type]
            heights=FieldArray(np.zeros(width * model.ground.heights.size)),
            flat=model.ground.flat,
            coulomb=model.ground.coulomb,
        ),
        body=Body(*(next(rest) for _ in Body._fields)),
        slack=model.slack,
    )
    return lanes, tables


def _zeros(robot: Robot, model: Model, width: int) -> LaneTables:
    """The tables of gaits of robots like this one, zeros, with its `model` in lanes."""
    structure, senses = robot.structure, robot.senses
    bodies, signals = len(structure.bodies), structure.signals
    contacts, size, neurons = len(structure.contacts), BLOCK * bodies, 2 * signals

    def table(*shape: int) -> FieldArray:
        return lane_table(shape, width)

    vectors = {name: table(size) for name in ("force", "end_force", "change", "stage", "k1", "k2")}
    tables: dict[str, Any] = {name: table(1) for name in LaneTables._fields}
    tables |= {name: table(signals) for name in ("output", "signals", "end_signals")}
    tables |= {
        "robot": model,
        "network": Network(
            first=FieldArray(np.full(neurons, neurons)),
            beyond=FieldArray(np.zeros(neurons, dtype=np.int64)),
            inhibition=lane_table((neurons, neurons), width, any_size=True),
            per_tau_a=table(neurons),
            per_tau_b=table(neurons),
            self_inhibition_weight=table(neurons),
        ),
        "senses": Senses(
            *(FieldArray(indices.copy()) for indices in senses[:_INDICES]),
            *(table(len(numbers)) for numbers in senses[_INDICES:]),
        ),
        "neurons": table(neurons, NEURON_COLUMNS),
        "gains": table(3),
        "sides": table(neurons),
        "tonic": table(neurons),
        "inputs": table(neurons),
        "lengths": table(len(structure.cables)),
        "normal_forces": table(contacts),
        "clock": table(CLOCK_ROWS),
        "modes": table(contacts, MODE_COLUMNS),
        "acceleration": table(size),
        "step": Step(
            state=table(13 * bodies),
            end=table(13 * bodies),
            rows=table(bodies, BLOCK, ROW),
            lines=table(JUNCTION_CABLES, 9),
            **vectors,
        ),
        "forces": Forces(
            nodes=table(len(structure.node_names), NODE_COLUMNS),
            frames=table(contacts, FRAME_COLUMNS),
            pulls=table(len(structure.cables), PULL_COLUMNS),
            pushes=table(contacts, 3),
        ),
        "tally": Tally(
            begins=table(1),
            time=table(1),
            signals=table(signals),
            lengths=table(len(structure.cables)),
            work=table(1),
            roughness=table(1),
            lifted=table(bodies),
            tension=table(1),
            clearance=table(1),
        ),
    }
    return LaneTables(**tables)
