"""A Gymnasium vector environment as the `VecEnv` that stable-baselines3 trains on."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from layoutexplore.envs.vector import ExplorationVectorEnv
from layoutexplore.errors import ConfigError
from layoutexplore.grids.arrays import Floats, Floats32, Mask
from layoutexplore.metrics.exploration import NEARLY_SEEN

Batch = Any
"""A batched observation: an array, or arrays by name."""

StepResult = tuple[Batch, Floats32, Mask, list[dict[str, Any]]]
"""Observations, rewards, which episodes ended, and infos."""


class VectorAdapter(VecEnv):
    """Steps a `gymnasium.vector.VectorEnv` that resets within the step (`AutoresetMode.SAME_STEP`).

    An info holds what that of the environment does: of the last step where an episode ends, of the first
    decision of all in `reset_infos`. `info["episode"]` of a step that ends one holds its return `r`, length
    `l`, `coverage`, `distance`, and `d95_share`, the metres after which a decision first found 95 % seen, as
    a share of the distance.

    Args:
        env: The vector environment. Its observations may have an `action_mask`; stopping, the last action, is
            then allowed only where nothing else is.

    Attributes:
        waiting_seconds: How long `receive` has waited.

    Raises:
        ConfigError: It resets in another way.
    """

    def __init__(self, env: VectorEnv[Any, Any, Any]) -> None:
        if env.metadata.get("autoreset_mode") != AutoresetMode.SAME_STEP:
            raise ConfigError(
                "training needs a vector environment that resets within the step (AutoresetMode.SAME_STEP)"
            )
        self.env: Any = env  # The class `VectorEnv` does not declare `call`, `get_attr` and `set_attr`.
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        self._masks: Mask | None = None
        self._next_seed: int | None = None
        self.waiting_seconds = 0.0

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """The seed of the next `reset`; it makes all that follows repeatable."""
        self._next_seed = seed
        self.action_space.seed(seed)
        return [seed] * self.num_envs

    def reset(self) -> Batch:
        """Begin an episode everywhere.

        Raises:
            ConfigError: `set_options` was given other options for some environments than for others.
        """
        options = self._options[0]
        if any(one is not options for one in self._options) and any(self._options):
            raise ConfigError(
                "the environments of a vector are reset with the same options: set_options(dict)"
            )
        observations, info = self.env.reset(seed=self._next_seed, options=options or None)
        self.reset_infos = _single(info, range(self.num_envs))
        self._next_seed = None
        self._reset_options()
        self._returns = np.zeros(self.num_envs)
        self._lengths = np.zeros(self.num_envs, np.int64)
        self._d95 = np.full(self.num_envs, np.nan)
        return self._seen(observations)

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> StepResult:
        """Make the step."""
        return self._step_result(slice(None), self.env.step(self._actions))

    @property
    def groups(self) -> Sequence[tuple[int, int]]:
        """Half-open ranges of environments that can be stepped without waiting for the others."""
        return self._native.groups

    def send(self, actions: NDArray[Any], group: int) -> None:
        """Begin a step of the environments of one group."""
        self._native.send(actions, group)

    def receive(self) -> tuple[int, StepResult]:
        """A group that was sent and is done, and what `step` tells, for its environments."""
        start = time.perf_counter()
        group, step = self._native.receive()
        self.waiting_seconds += time.perf_counter() - start
        return group, self._step_result(slice(*self.groups[group]), step)

    @property
    def _native(self) -> ExplorationVectorEnv:
        assert isinstance(self.env, ExplorationVectorEnv)
        return self.env

    def _step_result(self, rows: slice, step: tuple[Any, ...]) -> StepResult:
        """A step of some environments in the form of stable-baselines3."""
        observations, rewards, terminated, truncated, info = step
        done = terminated | truncated
        self._returns[rows] += rewards
        self._lengths[rows] += 1
        coverage, distance = (_at_the_end(info, name) for name in ("coverage", "distance"))
        lengths = self._d95[rows]
        reached = np.isnan(lengths) & (coverage >= NEARLY_SEEN)
        lengths[reached] = distance[reached]
        infos = _single(info, range(len(done)))
        for k in np.flatnonzero(done).tolist():
            infos[k] = _single(info.get("final_info", {}), [k])[0] | {
                "terminal_observation": info["final_obs"][k],
                "TimeLimit.truncated": bool(truncated[k] and not terminated[k]),
                "episode": self._episode((rows.start or 0) + k, float(coverage[k]), float(distance[k])),
            }
        return self._seen(observations, rows), rewards.astype(np.float32), done, infos

    def action_masks(self) -> Mask:
        """Which actions are allowed, bool (envs, actions)."""
        assert self._masks is not None
        return self._masks

    def close(self) -> None:
        """Close the environments."""
        self.env.close()

    def has_attr(self, attr_name: str) -> bool:
        """Whether the environments mask actions, where that is asked."""
        if attr_name == "action_masks":
            return "action_mask" in getattr(self.observation_space, "spaces", ())
        return super().has_attr(attr_name)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """What a method of some environments returns; without indices, of all."""
        if method_name == "action_masks" and self._masks is not None:
            found: Sequence[Any] = list(self.action_masks())
        else:
            found = self.env.call(method_name, *args, **kwargs)
        return [found[k] for k in self._get_indices(indices)]

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of some environments; without indices, of all."""
        found = self.env.get_attr(attr_name)
        return [found[k] for k in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of some environments to one value; without indices, of all."""
        chosen = set(self._get_indices(indices))
        kept = self.env.get_attr(attr_name) if len(chosen) < self.num_envs else ()
        values = [value if k in chosen else kept[k] for k in range(self.num_envs)]
        self.env.set_attr(attr_name, values)

    def get_images(self) -> Sequence[Any]:
        """A frame of each environment, for the render mode "rgb_array"."""
        return list(self.env.render())

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """None is wrapped."""
        return [False] * len(list(self._get_indices(indices)))

    def _seen(self, observations: Batch, rows: slice = slice(None)) -> Batch:
        if isinstance(observations, dict) and "action_mask" in observations:
            masks = observations["action_mask"].astype(np.bool_)
            masks[:, -1] = ~masks[:, :-1].any(axis=1)
            if self._masks is None:
                self._masks = np.zeros((self.num_envs, masks.shape[1]), np.bool_)
            self._masks[rows] = masks
        return observations

    def _episode(self, k: int, coverage: float, distance: float) -> dict[str, Any]:
        """The summary of an episode that ended; environment k starts the next one."""
        episode = {
            "r": float(self._returns[k]),
            "l": int(self._lengths[k]),
            "t": 0.0,
            "coverage": coverage,
            "distance": distance,
            "d95_share": float(self._d95[k] / max(distance, 1e-9)),
        }
        self._returns[k], self._lengths[k], self._d95[k] = 0.0, 0, np.nan
        return episode


def _single(info: dict[str, Any], rows: Iterable[int]) -> list[dict[str, Any]]:
    """The infos of some environments, each by itself and with numbers of Python, as single ones have them."""
    shown = {
        name: array.tolist() if array.ndim == 1 else array
        for name, array in info.items()
        if isinstance(array, np.ndarray) and name[:1] != "_" and name != "final_obs"
    }
    return [{name: array[k] for name, array in shown.items()} for k in rows]


def _at_the_end(info: dict[str, Any], name: str) -> Floats:
    """An entry of the infos (envs,) before any reset."""
    if "final_info" not in info:
        return np.asarray(info[name], np.float64)
    return np.asarray(np.where(info["_final_info"], info["final_info"][name], info[name]))
