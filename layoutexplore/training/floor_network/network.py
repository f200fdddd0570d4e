"""Training the network that completes maps; needs torch."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch.nn import functional

from layoutexplore.errors import ConfigError
from layoutexplore.grids.arrays import Bytes
from layoutexplore.predictors.floor_model.network import FOLD, LAYERS
from layoutexplore.training.floor_network.crops import draw_batch
from layoutexplore.training.torch_layers import JudgingNetwork, StepProgress, fit_network


@dataclass(frozen=True, kw_only=True)
class FloorTrainingConfig:
    """How the network is trained.

    Attributes:
        steps: Steps.
        rate: Highest learning rate; it rises for a tenth of the steps and then falls.
        batch: Crops a step.
        decay: Of the weights.
        seed: Of the weights and the draws.
        device: "cpu" or "cuda".
    """

    steps: int = 10_000
    rate: float = 4e-3
    batch: int = 32
    decay: float = 2e-2
    seed: int = 0
    device: str = "cpu"


class TrainableFloorNetwork(JudgingNetwork):
    """The network of `FloorNetwork` with what training needs besides."""

    def __init__(self) -> None:
        super().__init__(LAYERS)

    def forward(self, known: torch.Tensor) -> torch.Tensor:
        """Log-odds (batch, rows, cols) for squares (batch, KINDS, rows, cols)."""
        layers = self.layers
        full = layers["at_full"](functional.pixel_unshuffle(known, FOLD))
        half, fourth, low = self.halved(full)
        for name, skipped in (("up_to_fourth", fourth), ("up_to_half", half), ("up_to_full", full)):
            low = layers[name](torch.cat([functional.interpolate(low, scale_factor=2), skipped], 1))
        return functional.pixel_shuffle(self.judge(low), FOLD)[:, 0]


def train_floor_network(
    crops: Bytes, config: FloorTrainingConfig, progress: StepProgress, kept: Path | None = None
) -> dict[str, NDArray[np.float16]]:
    """The weights of a network that has learnt from crops, by name, with half precision.

    Args:
        crops: uint8 (n, bytes), as of `crops_of_plans`.
        config: How.
        progress: Receives the steps.
        kept: File for its state, from which a training that was stopped goes on.

    Raises:
        ConfigError: There is no crop.
    """
    if not len(crops):
        raise ConfigError("there is no map to learn from: name more floor plans, or more starts")
    torch.manual_seed(config.seed)
    network = TrainableFloorNetwork()

    def losses(step: int) -> tuple[torch.Tensor, torch.Tensor]:
        batch = draw_batch(crops, config.batch, np.random.default_rng([config.seed, step]))
        known, floor, weight = (torch.from_numpy(part).to(config.device) for part in batch)
        with torch.autocast(config.device, torch.bfloat16):
            found = network(known.to(memory_format=torch.channels_last))
        wrong = functional.binary_cross_entropy_with_logits(found.float(), floor, reduction="none")
        loss = (wrong * weight).sum() / weight.sum().clamp(min=1.0)
        return loss, loss

    fit_network(
        network,
        losses,
        steps=config.steps,
        rate=config.rate,
        decay=config.decay,
        progress=progress,
        kept=kept,
        device=config.device,
    )
    return {name: values.astype(np.float16) for name, values in network.weights().items()}
