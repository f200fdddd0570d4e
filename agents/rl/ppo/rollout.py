"""What a rollout has seen and done: groups of environments fill it, each at its own pace."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from sb3_contrib.common.maskable.buffers import MaskableDictRolloutBuffer
from torch import Tensor

from layoutexplore.agents.rl.networks.frontier_batch import FrontierBatch, Reader
from layoutexplore.grids.arrays import Floats32, Ints, Mask


class TrainingBatch(NamedTuple):
    """Decisions and what became of them.

    Attributes:
        batch: What was read.
        masks: bool (batch, actions), which were allowed.
        actions: int64 (batch,).
        log_probs: float32 (batch,), of the actions when they were taken.
        advantages: float32 (batch,).
        returns: float32 (batch,).
        weights: float32 (batch,), how much each counts.
    """

    batch: FrontierBatch
    masks: Tensor
    actions: Tensor
    log_probs: Tensor
    advantages: Tensor
    returns: Tensor
    weights: Tensor

    def take(self, chosen: Tensor) -> TrainingBatch:
        """Some of the decisions, int64 (k,)."""
        return TrainingBatch(self.batch.take(chosen), *(part[chosen] for part in self[1:]))


class Rollout(MaskableDictRolloutBuffer):
    """The buffer of stable-baselines3, whose rows are written in any order; arrays are (steps, envs, ...)."""

    def put(
        self, step: int, rows: slice, observation: dict[str, NDArray[Any]], masks: Mask, starts: Mask
    ) -> None:
        """What some environments show at a step, and whether episodes begin there."""
        for name, array in observation.items():
            self.observations[name][step, rows] = array
        self.action_masks[step, rows] = masks
        self.episode_starts[step, rows] = starts

    def put_actions(self, step: int, rows: slice, actions: Ints, log_probs: Floats32) -> None:
        """What was done there, with the logarithms of the probabilities."""
        self.actions[step, rows, 0], self.log_probs[step, rows] = actions, log_probs

    def read(self, reader: Reader) -> FrontierBatch:
        """All decisions, those of the first step first."""
        batch: FrontierBatch = reader(
            {name: self.to_torch(_flat(a), copy=False) for name, a in self.observations.items()}
        )
        return batch

    def training_batch(self, batch: FrontierBatch) -> TrainingBatch:
        """The decisions, once their values and returns are known."""
        masks, actions = self.action_masks.astype(np.bool_), self.actions[..., 0].astype(np.int64)
        rest = (self.log_probs, self.advantages, self.returns, np.ones_like(self.returns))
        return TrainingBatch(
            batch, *(self.to_torch(_flat(array), copy=False) for array in (masks, actions, *rest))
        )


def _flat(array: NDArray[Any]) -> NDArray[Any]:
    return array.reshape(-1, *array.shape[2:])


def parts_of(order: Tensor, size: int = 512) -> tuple[Tensor, ...]:
    """An order int64 (n,) cut into parts, by default so small that what is computed stays in the cache."""
    return torch.split(order, size)
