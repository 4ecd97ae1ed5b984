"""Environments for reinforcement learning, with the interface of Gymnasium (extra `gym`).

    >>> import gymnasium, tetra_drake.gym
    >>> environment = gymnasium.make("tetra_drake/Walk-v0", grouped=True)
    >>> many = gymnasium.make_vec("tetra_drake/Walk-v0", num_envs=64)

The import registers the environments with Gymnasium, as Gymnasium expects it of a package. The name
"tetra_drake.gym:tetra_drake/Walk-v0" makes Gymnasium import the module itself.

Observation, a row of numbers:

- lengths of the cables, as shares of the lengths at the start, minus 1; rates of these shares in
  1/s
- tensions of the cables, and loads of the contact nodes, as shares of the robot's weight
- orientations (quaternions, w first) of the bodies, and angular velocities in rad/s

Action: the signal of each driven cable, or of each oscillator with `grouped`, as a share of the
typical amplitude of the network's signals. Positive signals shorten the cable. An actuator gets the
setpoint of this signal, see Simulation: 0 is its setpoint at the start. Actions beyond -1 and 1 are
applied as they are.

Reward: the increase of the fitness, which the scenario's `objective` defines. Within an episode it
is the part of `rolled` and of the metrics that follow from positions. The last reward adds the
other metrics, so the sum of an episode's rewards is the fitness of the walk. If the robot fails,
the last reward makes the sum 0. Walk-v0 rewards each centimetre forward with 1, and punishes each
centimetre sideways with 0.5. Roll-v0 rewards each radian by which the robot has rolled forward with
1, and punishes each metre sideways with 4. A robot that stands still gets 0.

The time between actions is `simulation.control_period`, or the argument `control_period`. An
episode ends (terminated) if the robot fails, and (truncated) at `simulation.duration`. With
`disturbances` or `sensing` in the scenario, each episode has a draw of its own. Observations have
the errors of `sensing`, rewards are exact.

`env.unwrapped.save()` returns the state of the robot and of its episode, `restore(states)` puts it
back, also into another environment of the same kind, and returns the observation. So a tree search
can branch. The generator that draws disturbances in reset() is not restored, nor are wrappers.

A copy of an environment, by pickle or deepcopy, is made anew from the same arguments: it does not
have the state of the original, and begins with reset().
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tetra_drake.errors import InputError, SimulationFailure, check_type, check_whole
from tetra_drake.lab.stepping.simulation import Simulation, is_list
from tetra_drake.lab.stepping.states import States
from tetra_drake.results.result import SimulationResult, poses_of
from tetra_drake.robot.command import checked_actions
from tetra_drake.robot.readings import Readings
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import GivenScenario
from tetra_drake.scenario.metrics import METRICS

try:
    import gymnasium
    from gymnasium import spaces
    from gymnasium.utils import EzPickle, seeding
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space
except ImportError:
    raise InputError(
        "tetra_drake.gym", "", "needs Gymnasium: pip install 'tetra_drake[gym]'"
    ) from None

Info = dict[str, Any]

WALK, ROLL = "tetra_drake/Walk-v0", "tetra_drake/Roll-v0"
"""Names of the environments of a robot that walks, by default on the scenario `walk`, and of one
that rolls, by default on `roll`."""

_SOURCE, _MASK, _RENDERED = "tetra_drake.gym", "reset_mask", "rgb_array"

_OF_EPISODES = ("start", "steady", "offsets", "rewarded", "going")
"""Attributes of TensegrityVectorEnv, without underscore, that are the state of the episodes."""


class TensegrityVectorEnv(VectorEnv[np.ndarray, np.ndarray, np.ndarray], EzPickle):
    """Environments of many robots, which the compiled engine simulates in parallel; see
    tetra_drake.gym. They behave like environments of one robot in Gymnasium's SyncVectorEnv.

    By default a robot whose episode ends begins the next one in the next step, without a motion.
    With the `autoreset_mode` "SameStep" it begins in the same step; its last observation is in
    `final_obs` of the info.
    """

    metadata: Info = {"render_modes": [_RENDERED]}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int,
        scenario: GivenScenario,
        *,
        control_period: float | None = None,
        grouped: bool = False,
        record: bool = False,
        workers: int | None = None,
        max_episode_steps: int | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
    ) -> None:
        """Makes `num_envs` robots on a scenario. For the arguments not named here, see
        TensegrityEnv. `workers` is the number of threads, one per core by default. Episodes are
        truncated after `max_episode_steps`. `autoreset_mode` is "NextStep", "SameStep" or
        "Disabled"."""
        made: Info = {"control_period": control_period, "record": record, "workers": workers}
        shown: Info = {"grouped": grouped, "render_mode": render_mode}
        ended: Info = {"max_episode_steps": max_episode_steps, "autoreset_mode": autoreset_mode}
        EzPickle.__init__(self, num_envs, scenario, **made, **shown, **ended)
        check_type(_SOURCE, "grouped", grouped, bool)
        if render_mode is not None and str(render_mode) != _RENDERED:
            problem = f"found {render_mode!r:.60}, expected {_RENDERED!r} or None"
            raise InputError(_SOURCE, "render_mode", problem)
        if max_episode_steps is not None:
            check_whole(_SOURCE, "max_episode_steps", max_episode_steps, least=1)
        try:
            self._autoreset = AutoresetMode(autoreset_mode)
        except ValueError:
            modes = [mode.value for mode in AutoresetMode]
            problem = f"found {autoreset_mode!r:.60}, expected one of {modes}"
            raise InputError(_SOURCE, "autoreset_mode", problem) from None
        self.simulation = simulation = Simulation(scenario, count=num_envs, **made)
        self._most_steps, self._scenario = max_episode_steps, simulation.scenario
        robot, start, by_network = simulation.robot, simulation.state, Robot.of(self._scenario)
        structure = by_network.structure if grouped else robot.structure
        self._groups = structure.cables["signal"][robot.driven]  # the action of each driven cable
        self._cables, self._weight = by_network.starting_cables(), robot.weight
        self._start_lengths = start.lengths[:1]
        # Positions p_WN (N, nodes, 3) at the start and at `simulation.steady_from`.
        self._start, self._steady = start.p_WN, start.p_WN.copy()
        self._offsets, self._rewarded = np.zeros(num_envs), np.zeros(num_envs)
        self._going, self._ended = np.zeros((2, num_envs), dtype=bool)
        self.generators = [seeding.np_random()[0] for _ in range(num_envs)]
        """Generators of the robots (N,), which draw the seeds of their disturbances."""
        self.num_envs, self.render_mode = num_envs, render_mode
        frames_per_second = max(1, round(1.0 / simulation.control_period))
        self.metadata = {"render_modes": [_RENDERED], "render_fps": frames_per_second}
        self.metadata["autoreset_mode"] = self._autoreset
        size, actions = self._observe(start).shape[1], int(self._groups.max()) + 1
        self.single_observation_space = spaces.Box(-np.inf, np.inf, (size,), np.float64)
        self.single_action_space = spaces.Box(-1.0, 1.0, (actions,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: Info | None = None
    ) -> tuple[np.ndarray, Info]:
        """Begins episodes of all robots, or where `options["reset_mask"]` (N,) is True. `seed` is
        the seed of the first robot, and the next integers are the seeds of the others; or it is a
        list of seeds, one per robot. Returns the observations (N, size) and an empty info."""
        _check_options(options, _MASK)
        mask = (options or {}).get(_MASK, np.ones(self.num_envs, dtype=bool))
        is_mask = isinstance(mask, np.ndarray) and mask.dtype == bool and mask.any()
        if not is_mask or mask.shape != (self.num_envs,):
            problem = f"found {mask!r:.60}, expected an array of {self.num_envs} truths, one True"
            raise InputError(_SOURCE, f"options[{_MASK!r}]", problem)
        if is_list(seed):
            if len(seed) != self.num_envs:
                problem = f"found {len(seed)} seeds, expected {self.num_envs}"
                raise InputError(_SOURCE, "seed", problem)
            seeds = [_checked_seed(each) for each in seed]
        else:
            first = _checked_seed(seed)
            seeds = [None if first is None else first + i for i in range(self.num_envs)]
        for place in np.flatnonzero(mask):
            if seeds[place] is not None:
                self.generators[place] = seeding.np_random(seeds[place])[0]
        self._ended &= ~mask
        return self._begin(mask), {}

    def _begin(self, mask: np.ndarray) -> np.ndarray:
        """Begins episodes of the robots where `mask` (N,) is True. Returns the observations of all
        robots (N, size)."""
        places = np.flatnonzero(mask)
        seeds = [int(self.generators[place].integers(2**31)) for place in places]
        seen = self.simulation.reset(seed=seeds, indices=places)
        readings = self.simulation.state
        self._going[places] = True
        for place in places.tolist():
            self._start[place] = self._steady[place] = readings.p_WN[place]
            self._rewarded[place] = 0.0
            self._offsets[place] = self._fitness(readings, place)
        return self._observe(seen)

    def step(
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, Info]:
        """Simulates a control period. `actions` (N, actions) are shares of the typical amplitude,
        see tetra_drake.gym. Raises InputError for a robot without an episode."""
        simulation = self.simulation
        again = self._ended & (self._autoreset == AutoresetMode.NEXT_STEP)
        if again.any():
            self._begin(again)
        if (over := ~(again | self._going)).any():
            problem = f"robot {over.argmax()} has no episode; reset() begins one"
            raise InputError(_SOURCE, "step", problem)
        seen = simulation.step(self._setpoints(actions), indices=np.flatnonzero(~again))
        readings = simulation.state
        early = readings.time <= self._scenario.simulation.settling_time
        self._steady[early] = readings.p_WN[early]
        terminated = np.array([failure is not None for failure in simulation.failures])
        truncated = simulation.ended & ~terminated
        robots = range(self.num_envs)
        fitness = np.array([self._fitness(readings, robot) for robot in robots]) - self._offsets
        for place in np.flatnonzero(truncated).tolist():
            try:
                fitness[place] = simulation.result(place).fitness
            except SimulationFailure:  # known only at the end
                terminated[place], truncated[place] = True, False
        fitness[terminated] = 0.0
        if self._most_steps is not None:
            steps = readings.time / simulation.control_period
            truncated |= ~terminated & (steps > self._most_steps - 0.5)
        self._ended = terminated | truncated
        self._going &= ~self._ended
        observed, rewards = self._observe(seen), fitness - self._rewarded
        self._rewarded = fitness
        if self._autoreset != AutoresetMode.SAME_STEP or not self._ended.any():
            return observed, rewards, terminated, truncated, {}
        last = np.full(self.num_envs, None, dtype=object)
        for place in np.flatnonzero(self._ended).tolist():
            last[place] = observed[place]
        info: Info = {"final_obs": last, "_final_obs": self._ended, "final_info": {}}
        info["_final_info"] = self._ended
        return self._begin(self._ended), rewards, terminated, truncated, info

    def save(self) -> States:
        """States of all robots and their episodes; see restore()."""
        states = self.simulation.save(history=True)
        own = {f"episode.{name}": getattr(self, f"_{name}").copy() for name in _OF_EPISODES}
        return dataclasses.replace(states, tables={**states.tables, **own})

    def restore(self, states: States) -> np.ndarray:
        """Puts the robots and their episodes into saved states, and returns the observations.
        Raises InputError for states of another scenario, or of a simulation."""
        check_type(_SOURCE, "states", states, States)
        if "episode.going" not in states.tables:
            problem = "found states of a simulation, expected states of an environment"
            raise InputError(_SOURCE, "states", problem)
        readings = self.simulation.restore(states)
        for name in _OF_EPISODES:
            getattr(self, f"_{name}")[:] = states.tables[f"episode.{name}"]
        self._ended = ~self._going
        return self._observe(readings)

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Pictures (height, width, 3) of the robots now, in RGB; None without a `render_mode`."""
        from tetra_drake.lab.gym.picture import picture

        if not self.render_mode:
            return None
        return tuple(picture(self.simulation.robot, p_WN) for p_WN in self.simulation.state.p_WN)

    def _fitness(self, readings: Readings, place: int) -> float:
        """Fitness of the robot with the index `place` up to now, without the metrics that are known
        only at the end. `readings` is the state of all robots now."""
        scenario, structure = self._scenario, self.simulation.robot.structure
        nodes = np.stack([self._start[place], self._steady[place], readings.p_WN[place]])
        steady_time = scenario.simulation.duration - scenario.simulation.settling_time
        poses, objective = poses_of(structure, nodes, steady_time), scenario.objective
        fitness = 0.0
        for name, weight in objective.items():
            if METRICS[name].of_pose:
                fitness += weight * float(METRICS[name].compute(poses))
        return fitness + objective.get("rolled", 0.0) * float(self.simulation.rolled[place])

    def _setpoints(self, actions: np.ndarray) -> np.ndarray:
        """Setpoints (N, driven cables) of the actuators, in SI units, for actions (N, actions) of
        the environment. Each is a force, free length or tension, depending on the actuators."""
        shape = self.num_envs, int(self._groups.max()) + 1
        actions = checked_actions(actions, shape, source=_SOURCE)
        signals = self._scenario.cpg.usual_amplitude * actions[:, self._groups]
        return np.asarray(self._scenario.actuation.commands(self._cables._replace(signal=signals)))

    def _observe(self, readings: Readings) -> np.ndarray:
        """Observations of all robots (N, size) from their state; the module's docstring lists the
        parts of a row."""
        per_length, per_weight = 1.0 / self._start_lengths, 1.0 / self._weight
        parts = (
            readings.lengths * per_length - 1.0,
            readings.rates * per_length,
            readings.tensions * per_weight,
            readings.normal_forces * per_weight,
            readings.q_WB,
            readings.w_WB,
        )
        return np.hstack([part.reshape(self.simulation.count, -1) for part in parts])


class TensegrityEnv(gymnasium.Env[np.ndarray, np.ndarray], EzPickle):
    """Environment of one robot; see tetra_drake.gym for observation, action and reward."""

    metadata: Info = {"render_modes": [_RENDERED]}  # noqa: RUF012

    def __init__(
        self,
        scenario: GivenScenario,
        *,
        control_period: float | None = None,
        grouped: bool = False,
        record: bool = False,
        render_mode: str | None = None,
    ) -> None:
        """Args:
            scenario: a scenario, its name or file, or a run.
            control_period: time (s) between actions; by default the scenario's.
            grouped: if True, an action has a number for each oscillator, which moves all cables of
                the oscillator; otherwise for each driven cable.
            record: records the trajectories, for result().
            render_mode: "rgb_array" for pictures by render(); None for no pictures.

        Raises:
            InputError: if an argument does not fit the scenario.
        """
        options: Info = {"control_period": control_period, "grouped": grouped, "record": record}
        options["render_mode"] = render_mode
        EzPickle.__init__(self, scenario, **options)
        never = AutoresetMode.DISABLED
        self._one = TensegrityVectorEnv(1, scenario, workers=1, autoreset_mode=never, **options)
        self.metadata, self.render_mode = self._one.metadata, render_mode
        self.observation_space = self._one.single_observation_space
        self.action_space = self._one.single_action_space

    def reset(
        self, *, seed: int | None = None, options: Info | None = None
    ) -> tuple[np.ndarray, Info]:
        _check_options(options)
        super().reset(seed=_checked_seed(seed))
        self._one.generators = [self.np_random]
        return self._one.reset()[0][0], {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, Info]:
        seen, rewards, terminated, truncated, info = self._one.step(action)
        return seen[0], float(rewards[0]), bool(terminated[0]), bool(truncated[0]), info

    def render(self) -> np.ndarray | None:
        """The picture (height, width, 3) of the robot now; None without a `render_mode`."""
        pictures = self._one.render()
        return None if pictures is None else pictures[0]

    def save(self) -> States:
        """State of the robot and its episode; see restore()."""
        return self._one.save()

    def restore(self, states: States) -> np.ndarray:
        """Puts the robot and its episode into a saved state, and returns the observation. Raises
        InputError for states of another scenario, or of a simulation."""
        return self._one.restore(states)[0]

    def result(self) -> SimulationResult:
        """The result of the last episode, which must have reached `simulation.duration`; available
        until the next reset(). Raises its SimulationFailure if the robot failed, and InputError if
        the episode has not ended."""
        return self._one.simulation.result()


def _checked_seed(seed: Any) -> int | None:
    return None if seed is None else check_whole(_SOURCE, "seed", seed, least=0)


def _check_options(options: Info | None, *known: str) -> None:
    """Raises InputError if `options`, the argument of reset(), is neither None nor a mapping whose
    keys are all in `known`."""
    is_known = isinstance(options, Mapping) and set(options) <= set(known)
    if options is not None and not is_known:
        expected = " or ".join(["None", *known])
        raise InputError(_SOURCE, "options", f"found {options!r:.60}, expected {expected}")


for _name, _scenario in {WALK: "walk", ROLL: "roll"}.items():
    gymnasium.register(
        _name,
        entry_point="tetra_drake.gym:TensegrityEnv",
        vector_entry_point="tetra_drake.gym:TensegrityVectorEnv",
        kwargs={"scenario": _scenario},
    )
