"""Training the separator network (`layoutexplore evaluate train-separator`); needs torch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn
from torch.nn import functional

from layoutexplore.errors import ConfigError
from layoutexplore.grids.arrays import Floats32
from layoutexplore.layout.merging.separator.network import LAYERS, OUTPUTS, OUTSIDE, THING
from layoutexplore.training.folds import Progress, silent
from layoutexplore.training.separator.disturb import disturbed
from layoutexplore.training.separator.examples import SeparatorExample
from layoutexplore.training.separator.maps import mark_of, separator_examples
from layoutexplore.training.separator.targets import as_input, draw_crop, targets_of
from layoutexplore.training.torch_layers import Convolution, StepProgress, fit_network, plain_weights


@dataclass(frozen=True, kw_only=True)
class SeparatorTrainingConfig:
    """How the network is trained.

    Attributes:
        steps: Steps.
        rate: Highest learning rate; it rises for a tenth of the steps and then falls.
        batch: Crops a step.
        crop: Side of a crop, in places of the network.
        decay: Of the weights.
        side_weight: Of the loss of the outputs that are no borders and no pairs of squares.
        seed: Of the weights and the draws; those of a step depend on it and the step alone.
    """

    steps: int = 6000
    rate: float = 4e-3
    batch: int = 12
    crop: int = 48
    decay: float = 1e-3
    side_weight: float = 0.5
    seed: int = 0


class TrainableSeparator(nn.Module):
    """The network of `SeparatorNetwork` with what training needs besides."""

    def __init__(self) -> None:
        super().__init__()
        *hidden, last = LAYERS
        self.layers = nn.ModuleDict({name: Convolution(*LAYERS[name]) for name in hidden})
        self.judge = nn.Conv2d(LAYERS[last][0], LAYERS[last][1], 1)

    def forward(self, values: torch.Tensor) -> torch.Tensor:
        """Log-odds (batch, OUTPUTS, squares, squares) for (batch, channels, places, places)."""
        layers = self.layers
        full = layers["at_full"](layers["patch"](values))
        half = layers["at_half"](layers["to_half"](full))
        fourth = layers["at_fourth"](layers["to_fourth"](half))
        low = layers["at_eighth"](layers["to_eighth"](fourth))
        for smaller, skipped, at in (
            ("from_eighth", fourth, "wide"),
            ("from_fourth", half, "up_half"),
            ("from_half", full, "up_full"),
        ):
            low = layers[at](functional.interpolate(layers[smaller](low), scale_factor=2) + skipped)
        found = self.judge(low)
        batch, _, rows, cols = found.shape
        parts = found.reshape(batch, 2, 2, OUTPUTS, rows, cols).permute(0, 3, 4, 1, 5, 2)
        return torch.as_tensor(parts.reshape(batch, OUTPUTS, 2 * rows, 2 * cols))

    def weights(self) -> dict[str, Floats32]:
        """The weights as `SeparatorNetwork` takes them."""
        return plain_weights({**self.layers, "judge": self.judge})


def fit_separator(
    examples: Sequence[SeparatorExample],
    config: SeparatorTrainingConfig,
    progress: StepProgress,
    kept: Path | None = None,
) -> TrainableSeparator:
    """Train a network.

    Args:
        examples: Maps.
        config: How.
        progress: Receives the steps.
        kept: File for its state, from which a training that was stopped goes on.

    Raises:
        ConfigError: There is no map.
    """
    if not examples:
        raise ConfigError("there is no map to learn borders from: simulate more of them, or of other plans")
    torch.manual_seed(config.seed)
    network = TrainableSeparator()
    scale = torch.ones(OUTPUTS)
    scale[[OUTSIDE, THING]] = config.side_weight

    def losses(step: int) -> tuple[torch.Tensor, torch.Tensor]:
        values, truth, weight = draw_batch(examples, config, np.random.default_rng([config.seed, step]))
        wrong = functional.binary_cross_entropy_with_logits(network(values), truth, reduction="none")
        each = (wrong * weight).sum((0, 2, 3)) / weight.sum((0, 2, 3)).clamp(min=1.0)
        return (each * scale).sum(), each.mean()

    fit_network(
        network,
        losses,
        steps=config.steps,
        rate=config.rate,
        decay=config.decay,
        progress=progress,
        kept=kept,
    )
    return network


def draw_batch(
    examples: Sequence[SeparatorExample], config: SeparatorTrainingConfig, rng: np.random.Generator
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Inputs (batch, channels, places, places), truth and weights (batch, OUTPUTS, squares, squares)."""
    values, truth, weight = [], [], []
    for _ in range(config.batch):
        crop = disturbed(draw_crop(examples[int(rng.integers(len(examples)))], config.crop, rng), rng)
        values.append(as_input(crop.shares))
        found = targets_of(crop)
        truth.append(found[0])
        weight.append(found[1])
    stacked = (torch.from_numpy(np.stack(part)) for part in (values, truth, weight))
    return next(stacked), next(stacked), next(stacked)


def train_shipped_separator(
    count: int,
    plans: Sequence[str],
    config: SeparatorTrainingConfig,
    *,
    cache: Path | None = None,
    progress: Progress = silent,
) -> dict[str, NDArray[np.float16]]:
    """The weights of the network that ships, by name, with half precision.

    Args:
        count: Maps to simulate, some of which are left out.
        plans: Floor plans to simulate from besides generated ones.
        config: How it is trained.
        cache: Folder for what is learnt from and the state of the training: a run that was stopped goes on.
        progress: Told of what takes long.
    """
    examples = separator_examples(count, plans, cache=cache, progress=progress)
    network = fit_separator(
        examples,
        config,
        lambda done, steps, loss: progress(f"steps, mean loss {loss:.3f}", done, steps),
        kept=cache / f"training-{mark_of(plans)}-{count}-{config.seed}.safetensors" if cache else None,
    )
    return {name: values.astype(np.float16) for name, values in network.weights().items()}
