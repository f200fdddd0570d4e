"""A few environments stepped one after the other, their results written into rows of shared arrays.

A vector environment is made of such groups: one in its own process, or one per thread or worker process.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from layoutexplore.envs.base import ExplorationEnv
from layoutexplore.grids.arrays import Mask

Arrays = dict[str, NDArray[Any]]
"""Arrays by name, a row per environment."""

Allocate = Callable[[tuple[int, ...], np.dtype[Any]], NDArray[Any]]
"""Makes a zeroed array of a shape and dtype."""

Parts = dict[str, tuple[tuple[int, ...], np.dtype[Any]]]
"""Shapes and dtypes of one row, by name."""

Options = Mapping[str, Any] | None


@dataclass(frozen=True, eq=False)
class Buffers:
    """What environments read and write, a row each.

    Attributes:
        actions: (n, ...), read by `step`.
        observation: By key, (n, ...).
        info: By key, (n, ...).
        final_observation: The last observation of an episode, where the step that ended it began the next.
        final_info: Its info.
        flags: `reward` float64 and `terminated` and `truncated` bool, (n,) each.
    """

    actions: NDArray[Any]
    observation: Arrays
    info: Arrays
    final_observation: Arrays
    final_info: Arrays
    flags: Arrays

    @classmethod
    def allocate(cls, env: ExplorationEnv[Any], count: int, new: Allocate) -> Buffers:
        """Room for environments like this one."""
        space: Any = env.observation_space
        shapes = {key: (part.shape, np.dtype(part.dtype)) for key, part in space.spaces.items()}
        infos = {key: (zero.shape, zero.dtype) for key, zero in env.info_types.items()}
        flags: Parts = {"reward": ((), np.dtype(np.float64))}
        flags |= {name: ((), np.dtype(np.bool_)) for name in ("terminated", "truncated")}

        def rows(parts: Parts) -> Arrays:
            return {name: new((count, *shape), dtype) for name, (shape, dtype) in parts.items()}

        action = (env.action_space.shape or (), np.dtype(env.action_space.dtype))
        actions = rows({"action": action})["action"]
        return cls(actions, rows(shapes), rows(infos), rows(shapes), rows(infos), rows(flags))

    def rows(self, begin: int, end: int) -> Buffers:
        """Views of some rows; of all of them, the arrays themselves."""
        if (begin, end) == (0, len(self.actions)):
            return self

        def cut(arrays: Arrays) -> Arrays:
            return {name: array[begin:end] for name, array in arrays.items()}

        parts = (self.observation, self.info, self.final_observation, self.final_info, self.flags)
        return Buffers(self.actions[begin:end], *map(cut, parts))


class EnvironmentGroup:
    """A group of environments and the rows they write.

    Args:
        make: Makes each of them.
        buffers: As many rows as there are to be environments.
        autoreset: When the next episode begins.
        max_episode_steps: Steps after which an episode is truncated; None for no such limit.
    """

    def __init__(
        self,
        make: Callable[[], ExplorationEnv[Any]],
        buffers: Buffers,
        autoreset: AutoresetMode,
        max_episode_steps: int | None,
    ) -> None:
        self._buffers, self._autoreset, self._limit = buffers, autoreset, max_episode_steps
        self.envs = [make() for _ in range(len(buffers.actions))]
        self._steps = np.zeros(len(self.envs), np.int64)

    def execute(self, command: str, *arguments: Any) -> Any:
        """Do what a vector environment asks for: one of the methods below, by name."""
        return getattr(self, command)(*arguments)

    def reset(self, seeds: Sequence[int | None], options: Options, chosen: Mask) -> None:
        """Begin an episode in the chosen environments bool (n,)."""
        for k in np.flatnonzero(chosen).tolist():
            self._begin(k, seeds[k], options)
            self._note(k, 0.0, False, False)

    def step(self) -> None:
        """Act in every environment; ended episodes are followed by new ones as the mode says."""
        flags, next_step = self._buffers.flags, self._autoreset == AutoresetMode.NEXT_STEP
        for k in range(len(self.envs)):
            if next_step and (flags["terminated"][k] or flags["truncated"][k]):
                self._begin(k, None, None)
                self._note(k, 0.0, False, False)
            else:
                self._act(k)

    def call(self, name: str, positional: tuple[Any, ...], named: dict[str, Any]) -> list[Any]:
        """An attribute of each environment, or the result of calling it."""
        found = [env.get_wrapper_attr(name) for env in self.envs]
        return [value(*positional, **named) if callable(value) else value for value in found]

    def set_attr(self, name: str, values: Sequence[Any]) -> None:
        """Set an attribute of each environment."""
        for env, value in zip(self.envs, values, strict=True):
            env.set_wrapper_attr(name, value)

    def close(self) -> None:
        """Close every environment."""
        for env in self.envs:
            env.close()

    def _begin(self, k: int, seed: int | None, options: Options) -> None:
        observation, info = self.envs[k].reset(seed=seed, options=dict(options) if options else None)
        _write(self._buffers.observation, k, observation)
        _write(self._buffers.info, k, info)
        self._steps[k] = 0

    def _act(self, k: int) -> None:
        buffers = self._buffers
        observation, reward, terminated, truncated, info = self.envs[k].step(buffers.actions[k])
        self._steps[k] += 1
        truncated = truncated or (self._limit is not None and self._steps[k] >= self._limit)
        over = terminated or truncated
        if over and self._autoreset == AutoresetMode.SAME_STEP:
            _write(buffers.final_observation, k, observation)
            _write(buffers.final_info, k, info)
            self._begin(k, None, None)
        else:
            _write(buffers.observation, k, observation)
            _write(buffers.info, k, info)
        self._note(k, float(reward), terminated, truncated)

    def _note(self, k: int, reward: float, terminated: bool, truncated: bool) -> None:
        flags = self._buffers.flags
        flags["reward"][k], flags["terminated"][k], flags["truncated"][k] = reward, terminated, truncated


def _write(arrays: Arrays, k: int, values: Mapping[str, Any]) -> None:
    for name, array in arrays.items():
        array[k] = values[name]
