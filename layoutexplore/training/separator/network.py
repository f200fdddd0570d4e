"""Training the separator network (`layoutexplore evaluate train-separator`); needs torch."""

from __future__ import annotations

import time
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, replace
from multiprocessing import get_all_start_methods
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch.nn import functional
from torch.utils.data import DataLoader, Dataset

from layoutexplore.agents.rl.networks.training_state import chosen_device
from layoutexplore.errors import ConfigError
from layoutexplore.layout.merging.separator.network import LAYERS, OUTPUTS, OUTSIDE, THING
from layoutexplore.plugins.transport import worker_killed
from layoutexplore.training.folds import Progress, silent
from layoutexplore.training.separator.crops import stacked_crops
from layoutexplore.training.separator.examples import SeparatorExample
from layoutexplore.training.separator.maps import mark_of, separator_examples
from layoutexplore.training.separator.targets import as_input, targets_of
from layoutexplore.training.torch_layers import JudgingNetwork, StepProgress, fit_network


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
        workers: Processes that simulate maps and draw crops; 0 for this one. They change no result.
        device: "cpu", "cuda", or "auto" for "cuda" where there is one.
    """

    steps: int = 14000
    rate: float = 4e-3
    batch: int = 64
    crop: int = 48
    decay: float = 1e-3
    side_weight: float = 0.5
    seed: int = 0
    workers: int = 0
    device: str = "auto"


class TrainableSeparator(JudgingNetwork):
    """The network of `SeparatorNetwork` with what training needs besides."""

    def __init__(self) -> None:
        super().__init__(LAYERS)

    def forward(self, values: torch.Tensor) -> torch.Tensor:
        """Log-odds (batch, OUTPUTS, squares, squares) for (batch, channels, places, places)."""
        layers = self.layers
        full = layers["at_full"](layers["patch"](values))
        half, fourth, low = self.halved(full)
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
        ConfigError: There is no map, or no such device.
        WorkerError: A worker was killed.
    """
    if not examples:
        raise ConfigError("there is no map to learn borders from: simulate more of them, or of other plans")
    torch.manual_seed(config.seed)
    network = TrainableSeparator()
    device = chosen_device(config.device)
    scale = torch.ones(OUTPUTS, device=device)
    scale[[OUTSIDE, THING]] = config.side_weight
    batches: Iterator[tuple[torch.Tensor, ...]] | None = None

    def losses(step: int) -> tuple[torch.Tensor, torch.Tensor]:
        nonlocal batches
        if batches is None:
            batches = _batches(examples, config, step)
        shares, *truths = (part.to(device, non_blocking=True) for part in next(batches))
        truth, weight = targets_of(shares, *truths)
        wrong = functional.binary_cross_entropy_with_logits(
            network(as_input(shares)), truth, reduction="none"
        )
        each = (wrong * weight).sum((0, 2, 3)) / weight.sum((0, 2, 3)).clamp(min=1.0)
        return (each * scale).sum(), each.mean()

    try:
        fit_network(
            network,
            losses,
            steps=config.steps,
            rate=config.rate,
            decay=config.decay,
            progress=progress,
            kept=kept,
            device=device,
        )
    except RuntimeError as error:  # torch has no error of its own for it
        if "DataLoader worker (pid" not in str(error):
            raise
        raise worker_killed(config.workers) from error
    return network


class _Steps(Dataset[tuple[torch.Tensor, ...]]):
    """The crops of each step."""

    def __init__(self, examples: Sequence[SeparatorExample], config: SeparatorTrainingConfig) -> None:
        self.examples, self.config = examples, config

    def __getitem__(self, step: int) -> tuple[torch.Tensor, ...]:
        config = self.config
        rng = np.random.default_rng([config.seed, step])
        crops = stacked_crops(self.examples, config.batch, config.crop, rng)
        return tuple(map(torch.from_numpy, astuple(crops)))


def _batches(
    examples: Sequence[SeparatorExample], config: SeparatorTrainingConfig, first: int
) -> Iterator[tuple[torch.Tensor, ...]]:
    """The crops of the steps from `first` on, in order; workers share the maps that this process has read."""
    loader = DataLoader(
        _Steps(examples, config),
        batch_size=None,
        sampler=range(first, config.steps),
        num_workers=config.workers,
        multiprocessing_context="fork" if config.workers and "fork" in get_all_start_methods() else None,
    )
    try:
        yield from loader
    except (ConnectionError, EOFError) as error:  # a killed worker; torch says so a moment later
        time.sleep(1.0)
        raise worker_killed(config.workers) from error


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
    examples = separator_examples(count, plans, cache=cache, workers=config.workers, progress=progress)
    # What changes what is learnt tells trainings apart; other steps are refused where the state is read.
    how = zlib.crc32(repr(replace(config, steps=0, workers=0, device="")).encode())
    network = fit_separator(
        examples,
        config,
        lambda done, steps, loss: progress(f"steps, mean loss {loss:.3f}", done, steps),
        kept=cache / f"training-{mark_of(plans)}-{count}-{how:08x}.safetensors" if cache else None,
    )
    return {name: values.astype(np.float16) for name, values in network.weights().items()}
