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
the last reward makes the sum 0.

The time between actions is `simulation.control_period`, or the argument `control_period`. An
episode ends (terminated) if the robot fails, and (truncated) at `simulation.duration`. With
`disturbances` in the scenario, each episode has a draw of its own.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tetra_drake.engines.simulation import Simulation, checked_actions
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.results.metrics import pose_fitness, poses_of
from tetra_drake.robot.readings import Readings, pitch_rates
from tetra_drake.robot.robot import AMPLITUDE, Robot
from tetra_drake.scenario.load import GivenScenario
from tetra_drake.scenario.scenario import Scenario

try:
    import gymnasium
    from gymnasium import spaces
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space
except ImportError:
    raise InputError(
        "tetra_drake.gym", "", "needs Gymnasium: pip install 'tetra_drake[gym]'"
    ) from None

Info = dict[str, Any]

WALK, ROLL = "tetra_drake/Walk-v0", "tetra_drake/Roll-v0"
"""Names of the environments of a robot that walks, by default on the scenario `coulomb`, and of one
that rolls, by default on `rover`."""


class _Episodes:
    """Episodes of robots side by side: observations, actions and rewards of all environments."""

    def __init__(self, simulation: Simulation, *, grouped: bool) -> None:
        self.simulation = simulation
        self._scenario: Scenario = simulation.scenario
        robot, count, start = simulation.robot, simulation.count, simulation.state
        by_network = Robot.of(self._scenario)
        structure = by_network.structure if grouped else robot.structure
        self._groups = structure.drivers[robot.driven]  # the action of each driven cable
        self._cables, self._weight = by_network.starting_cables(), robot.weight
        self._start_lengths = start.lengths[:1]
        size = self._observe(start).shape[1]
        self.observation_space = spaces.Box(-np.inf, np.inf, (size,), np.float64)
        self.action_space = spaces.Box(-1.0, 1.0, (self._groups.max() + 1,), np.float32)
        # Positions p_WN (N, nodes, 3) at the start and at `simulation.steady_from`.
        self._start, self._steady = start.p_WN, start.p_WN.copy()
        # Time, pitch rate, and angle by which it has rolled, of each robot (N,).
        self._time, self._rate, self._rolled = np.zeros(count), np.zeros(count), np.zeros(count)
        self._offsets, self._rewarded = np.zeros(count), np.zeros(count)

    def reset(self, seed: int, places: np.ndarray) -> np.ndarray:
        """Begins episodes. Returns the observations of all robots."""
        readings = self.simulation.reset(seed=seed, indices=places)
        for place in places.tolist():
            self._start[place] = self._steady[place] = readings.p_WN[place]
            self._time[place] = self._rate[place] = self._rolled[place] = 0.0
            self._rewarded[place] = 0.0
            self._offsets[place] = self._fitness(readings, place)
        return self._observe(readings)

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Simulates a control period. Returns observations, rewards, and whether episodes are
        terminated and truncated."""
        simulation = self.simulation
        readings = simulation.step(self._setpoints(actions))
        self._roll(readings)
        early = readings.time <= self._scenario.simulation.settling_time
        self._steady[early] = readings.p_WN[early]
        terminated = np.array([failure is not None for failure in simulation.failures])
        truncated = simulation.ended & ~terminated
        places = range(simulation.count)
        fitness = np.array([self._fitness(readings, place) for place in places], dtype=float)
        fitness -= self._offsets
        for place in np.flatnonzero(truncated).tolist():
            try:
                fitness[place] = simulation.result(place).fitness
            except SimulationFailure:  # known only at the end
                terminated[place], truncated[place] = True, False
        fitness[terminated] = 0.0
        rewards = fitness - self._rewarded
        self._rewarded = fitness
        return self._observe(readings), rewards, terminated, truncated

    def _fitness(self, readings: Readings, place: int) -> float:
        """The fitness up to now, without the metrics that are known only at the end."""
        scenario, structure = self._scenario, self.simulation.robot.structure
        nodes = np.stack([self._start[place], self._steady[place], readings.p_WN[place]])
        steady_time = scenario.simulation.duration - scenario.simulation.settling_time
        fitness = pose_fitness(poses_of(structure, nodes, steady_time), scenario.objective)
        return fitness + scenario.objective.get("rolled", 0.0) * self._rolled[place]

    def _roll(self, readings: Readings) -> None:
        """Adds a control period to the angles by which the robots have rolled."""
        if "rolled" in self._scenario.objective:
            rate = pitch_rates(readings, self.simulation.robot.structure)
            self._rolled += 0.5 * (readings.time - self._time) * (self._rate + rate)
            self._time, self._rate = readings.time, rate

    def _setpoints(self, actions: np.ndarray) -> np.ndarray:
        """Setpoints (N, driven cables) of the actuators for actions of the environment."""
        shape = self.simulation.count, *self.action_space.shape
        actions = checked_actions(actions, shape, source="tetra_drake.gym")
        cpg = self._scenario.cpg
        amplitude = abs(cpg.gain) * AMPLITUDE * abs(cpg.external_input)
        signals = amplitude * actions[:, self._groups]
        setpoints: np.ndarray = self._scenario.actuation.commands(
            self._cables._replace(signal=signals)
        )
        return setpoints

    def _observe(self, readings: Readings) -> np.ndarray:
        """Observations (N, size)."""
        per_length, per_weight = 1.0 / self._start_lengths, 1.0 / self._weight
        parts = (
            readings.lengths * per_length - 1.0,
            readings.rates * per_length,
            readings.tensions * per_weight,
            readings.normal_forces * per_weight,
            readings.q_WB,
            readings.w_WB,
        )
        count = self.simulation.count
        return np.hstack([part.reshape(count, -1) for part in parts])


class TensegrityEnv(gymnasium.Env[np.ndarray, np.ndarray]):
    """Environment of one robot; see tetra_drake.gym for observation, action and reward."""

    def __init__(
        self,
        scenario: GivenScenario,
        *,
        control_period: float | None = None,
        grouped: bool = False,
    ) -> None:
        """Args:
            scenario: a scenario, its name or file, or a run.
            control_period: time (s) between actions; by default the scenario's.
            grouped: an action for each oscillator, otherwise for each driven cable.

        Raises:
            InputError: if an argument does not fit the scenario.
        """
        simulation = Simulation(scenario, control_period=control_period, workers=1)
        self._episodes = _Episodes(simulation, grouped=grouped)
        self.observation_space = self._episodes.observation_space
        self.action_space = self._episodes.action_space

    def reset(
        self, *, seed: int | None = None, options: Info | None = None
    ) -> tuple[np.ndarray, Info]:
        super().reset(seed=seed)
        draw = int(self.np_random.integers(2**31))
        return self._episodes.reset(draw, np.array([0]))[0], {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, Info]:
        observations, rewards, terminated, truncated = self._episodes.step(action)
        return observations[0], float(rewards[0]), bool(terminated[0]), bool(truncated[0]), {}


class TensegrityVectorEnv(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """Environments of robots side by side, in the lanes and threads of the compiled engine; see
    tetra_drake.gym.

    A robot whose episode ends begins the next one in the same step; its last observation is in
    `final_obs` of the info.
    """

    def __init__(
        self,
        num_envs: int,
        scenario: GivenScenario,
        *,
        control_period: float | None = None,
        grouped: bool = False,
        workers: int | None = None,
    ) -> None:
        """See TensegrityEnv. `workers` is the number of threads; one per core by
        default."""
        self.metadata = {"autoreset_mode": AutoresetMode.SAME_STEP}
        self.num_envs = num_envs
        simulation = Simulation(
            scenario, count=num_envs, control_period=control_period, workers=workers
        )
        self._episodes = _Episodes(simulation, grouped=grouped)
        self.single_observation_space = self._episodes.observation_space
        self.single_action_space = self._episodes.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(
        self, *, seed: int | None = None, options: Info | None = None
    ) -> tuple[np.ndarray, Info]:
        super().reset(seed=seed)
        return self._begin(np.arange(self.num_envs)), {}

    def step(
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, Info]:
        observations, rewards, terminated, truncated = self._episodes.step(actions)
        ended = terminated | truncated
        if not ended.any():
            return observations, rewards, terminated, truncated, {}
        last = np.full(self.num_envs, None, dtype=object)
        for place in np.flatnonzero(ended).tolist():
            last[place] = observations[place]
        info = {"final_obs": last, "_final_obs": ended}
        return self._begin(np.flatnonzero(ended)), rewards, terminated, truncated, info

    def _begin(self, places: np.ndarray) -> np.ndarray:
        """Begins episodes. Returns the observations of all robots."""
        return self._episodes.reset(int(self.np_random.integers(2**31)), places)


for _name, _scenario in {WALK: "coulomb", ROLL: "rover"}.items():
    gymnasium.register(
        _name,
        entry_point="tetra_drake.gym:TensegrityEnv",
        vector_entry_point="tetra_drake.gym:TensegrityVectorEnv",
        kwargs={"scenario": _scenario},
    )
