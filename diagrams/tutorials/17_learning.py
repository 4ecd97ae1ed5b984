"""Reinforcement learning: PPO of Stable-Baselines3, on robots side by side in one environment.

pip install stable-baselines3, and pip install 'tetra_drake[gym]'. The option Roll-v0 takes a rover.
"""

# %% An environment of many robots, as Stable-Baselines3 wants it.
import sys
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from matplotlib.figure import Figure
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecEnv, VecMonitor, VecNormalize

from tetra_drake.gym import ROLL, WALK

name, grouped, steps, robots = WALK, True, 200_000, 32
if sys.argv[1:] == ["Roll-v0"]:
    name, grouped, steps = ROLL, False, 300_000


class Robots(VecEnv):
    """Robots of a TensegrityVectorEnv that begin again in the same step as they end."""

    def __init__(self, robots: Any) -> None:
        self.robots = robots
        super().__init__(
            robots.num_envs, robots.single_observation_space, robots.single_action_space
        )

    def reset(self) -> Any:
        seen, _ = self.robots.reset(seed=self._seeds)
        self._reset_seeds()
        return seen

    def step_async(self, actions: np.ndarray) -> None:
        self.actions = actions

    def step_wait(self) -> Any:
        seen, rewards, terminated, truncated, info = self.robots.step(self.actions)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for i in np.flatnonzero(ended := terminated | truncated):
            infos[i] = {"terminal_observation": info["final_obs"][i]}
            infos[i]["TimeLimit.truncated"] = bool(truncated[i])
        return seen, rewards, ended, infos

    def get_images(self) -> list[np.ndarray]:
        return list(self.robots.render() or [])

    def close(self) -> None:
        self.robots.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        return [getattr(self.robots, attr_name)] * len(self._get_indices(indices))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        raise NotImplementedError("all robots have one environment")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kw: Any) -> Any:
        raise NotImplementedError("all robots have one environment")

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        return [False] * len(self._get_indices(indices))


# %% PPO, with the same digits for the same seed on the same processor.
options: dict[str, Any] = {"num_envs": robots, "grouped": grouped, "autoreset_mode": "SameStep"}
together = Robots(gymnasium.make_vec(name, **options))
scaled = VecNormalize(VecMonitor(together), gamma=0.99)
learner = PPO(
    "MlpPolicy",
    scaled,
    n_steps=128,
    batch_size=512,
    policy_kwargs={"log_std_init": -1.0},
    seed=0,
    device="cpu",
)
curve: list[tuple[int, float]] = []
while learner.num_timesteps < steps:
    learner.learn(steps // 8, reset_num_timesteps=False)
    episodes = [episode["r"] for episode in learner.ep_info_buffer or []]
    curve.append((learner.num_timesteps, float(np.mean(episodes)) if episodes else 0.0))
    print(f"{curve[-1][0]:7d} steps: {curve[-1][1]:.1f}", flush=True)


# %% An episode of the trained policy, and of others to compare. A replay shows the trained one.
alone: Any = gymnasium.make(name, grouped=grouped, record=True)


def score(act: Any) -> float:
    """Sum of the rewards of an episode with actions that are a function of the observation."""
    (seen, _), total, ended = alone.reset(seed=0), 0.0, False
    while not ended:
        seen, reward, terminated, truncated, _ = alone.step(act(seen))
        total, ended = total + float(reward), terminated or truncated
    return total


still = score(lambda seen: np.zeros(alone.action_space.shape or 0))
alone.action_space.seed(0)
drawn = score(lambda seen: alone.action_space.sample())
trained = score(lambda s: learner.predict(scaled.normalize_obs(s), deterministic=True)[0])
alone.unwrapped.result().save_replay(f"{Path(__file__).stem}.html")
print(f"standing still {still:.1f}, random actions {drawn:.1f}, trained policy {trained:.1f}")
figure = Figure(figsize=(7.0, 3.0), layout="constrained")
axes = figure.subplots()
axes.plot(*np.transpose(curve), label="while it learns, with noise")
for level, label in ((trained, "trained"), (still, "standing still"), (drawn, "random")):
    axes.axhline(level, color="0.6", linewidth=0.8)
    axes.annotate(label, (0.01, level), xycoords=("axes fraction", "data"), va="bottom")
axes.set(xlabel="steps of robots", ylabel="sum of an episode's rewards")
axes.margins(y=0.12)
axes.legend()
figure.savefig(f"{Path(__file__).stem}.png", dpi=120)
