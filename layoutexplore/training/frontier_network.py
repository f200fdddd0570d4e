"""Training the network that scores frontiers (`layoutexplore evaluate train-predictor`); needs torch.

It learns from generated plans and from real ones at once: from real ones alone it learns them by heart.
Crops are mirrored at random. Beside what it is for it learns to draw what the unknown in a crop is in
truth, which tells far more than the class of a frontier does and makes its scores better; the layers for that
are not kept. What is learnt is then rounded to whole numbers, as `FrontierNetwork` wants it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn
from torch.nn import functional

from layoutexplore.frontiers.classes import LITTLE_LEFT
from layoutexplore.grids.arrays import Bytes, Floats, Mask
from layoutexplore.predictors.frontier_model.network import LAYERS, MOST, WIDTHS
from layoutexplore.predictors.frontier_model.network_input import KNOWN
from layoutexplore.training.folds import building_weights
from layoutexplore.training.predictor_samples import CropSamples
from layoutexplore.training.torch_layers import Convolution, StepProgress, fit_network, plain_weights

DRAWN = 32
"""Channels from which cells are drawn."""

CALIBRATED, RARE = 2000, 99.99
"""Crops that tell how large numbers between layers get, and the percentile of these that is just kept."""


@dataclass(frozen=True, kw_only=True)
class FrontierNetworkConfig:
    """How the network is trained.

    Attributes:
        steps: Steps.
        generated_share: Share of the crops of generated plans, if there are others.
        rate: Highest learning rate; it rises for a tenth of the steps and then falls.
        decay: Of the weights.
        dropout: Share of the numbers that are hidden before crops are summed up.
        batch: Crops a step.
        leftover_weight, area_weight, drawing_weight: Of the other losses against that of "closed".
        seed: Of the weights and the draws.
    """

    steps: int = 1500
    generated_share: float = 0.5
    rate: float = 3e-3
    decay: float = 2e-2
    dropout: float = 0.2
    batch: int = 256
    leftover_weight: float = 0.5
    area_weight: float = 0.3
    drawing_weight: float = 0.5
    seed: int = 0


class TrainableFrontierNetwork(nn.Module):
    """A `FrontierNetwork` before it is rounded."""

    def __init__(self, dropout: float) -> None:
        super().__init__()
        self.dropout = nn.Dropout(dropout)
        self.layers = nn.ModuleDict(
            {
                name: Convolution(*layer) if layer[2] > 1 else nn.Linear(*layer[:2])
                for name, layer in LAYERS.items()
            }
        )
        half, fourth, eighth = WIDTHS
        self.draw_fourth = Convolution(eighth + fourth, fourth, 3, 1)
        self.draw_half = Convolution(fourth + half, DRAWN, 3, 1)
        self.draw = nn.ConvTranspose2d(DRAWN, KNOWN, 2, 2)

    def forward(self, values: torch.Tensor) -> torch.Tensor:
        """Scores (batch, 3), as of `FrontierNetwork.score`, of crops (batch, PLANES, SIDE, SIDE)."""
        found: torch.Tensor = self.layers["judge"](self.hidden(values)["weigh"])
        return found

    def drawing(self, hidden: Mapping[str, torch.Tensor]) -> torch.Tensor:
        """Log-odds (batch, KNOWN, SIDE, SIDE) of the classes of `draw_truth`, from what the layers found."""
        coarse = self.draw_fourth(torch.cat([_twice(hidden["to_eighth"]), hidden["at_fourth"]], dim=1))
        drawn: torch.Tensor = self.draw(self.draw_half(torch.cat([_twice(coarse), hidden["at_half"]], dim=1)))
        return drawn

    def hidden(self, values: torch.Tensor) -> dict[str, torch.Tensor]:
        """What all layers but the last find, by name."""
        found: dict[str, torch.Tensor] = {}
        for name, layer in self.layers.items():
            if name == "sum_up":
                values = self.dropout(values.permute(0, 2, 3, 1).flatten(1))
            if name != "judge":
                values = found[name] = functional.relu(layer(values))
        return found


def _twice(values: torch.Tensor) -> torch.Tensor:
    return functional.interpolate(values, scale_factor=2.0)


def train_frontier_network(
    generated: Sequence[CropSamples],
    real: Sequence[CropSamples],
    groups: Mapping[str, str],
    config: FrontierNetworkConfig,
    progress: StepProgress,
) -> dict[str, NDArray[np.generic]]:
    """Train the network.

    Args:
        generated: Crops of generated plans; there may be none.
        real: Crops of other plans; there may be none, but not of both.
        groups: The building of a plan by its name.
        config: How.
        progress: Receives the steps.

    Returns:
        Weights as `FrontierNetwork` takes them.
    """
    torch.manual_seed(config.seed)
    batches = CropBatches(CropPool(generated, {}), CropPool(real, groups), config)
    network = TrainableFrontierNetwork(config.dropout)
    fit_frontier_network(network, batches, config, progress)
    return quantised_weights(network, batches.draw(CALIBRATED)[0])


_Drawn = tuple[Bytes, np.bool_, np.float64, Bytes]
"""A crop, whether its frontier is closed, the area left, and the truth of its cells."""


_Batch = tuple[Bytes, Mask, Floats, Bytes]
"""The same of many: crops (n, SIDE, SIDE, PLANES), classes and areas (n,), truth (n, SIDE, SIDE)."""


class CropPool:
    """Draws crops of several plans, weighted by building (`building_weights`)."""

    def __init__(self, parts: Sequence[CropSamples], groups: Mapping[str, str]) -> None:
        sizes = [len(part.closed) for part in parts]
        self.size, self._parts, self._first = sum(sizes), parts, np.cumsum([0, *sizes])
        names = np.repeat(np.array([groups.get(part.plan, part.plan) for part in parts], np.str_), sizes)
        self._rising = np.cumsum(building_weights(names)) if self.size else np.zeros(0)

    def draw(self, count: int, rng: np.random.Generator) -> Iterator[_Drawn]:
        """One sample, so many times."""
        if not count:
            return
        drawn = np.searchsorted(self._rising, rng.random(count) * self._rising[-1], side="right")
        chosen = np.minimum(drawn, self.size - 1)
        which = np.searchsorted(self._first, chosen, side="right") - 1
        for k, row in zip(which.tolist(), (chosen - self._first[which]).tolist(), strict=True):
            part = self._parts[k]
            yield part.crops[row], part.closed[row], part.area[row], part.truth[row]


class CropBatches:
    """Batches of generated and of real crops, half of them mirrored."""

    def __init__(self, generated: CropPool, real: CropPool, config: FrontierNetworkConfig) -> None:
        self._generated, self._real = generated, real
        self._share = config.generated_share if generated.size and real.size else float(generated.size > 0)
        self._rng = np.random.default_rng(config.seed)

    def draw(self, count: int) -> _Batch:
        """So many samples."""
        generated = int(self._rng.binomial(count, self._share))
        drawn = [*self._generated.draw(generated, self._rng), *self._real.draw(count - generated, self._rng)]
        crops, closed, area, truth = (np.array(values) for values in zip(*drawn, strict=True))
        step = -1 if self._rng.random() < 0.5 else 1
        return crops[:, :, ::step], closed, area, truth[:, :, ::step]


def fit_frontier_network(
    network: TrainableFrontierNetwork,
    batches: CropBatches,
    config: FrontierNetworkConfig,
    progress: StepProgress,
) -> None:
    """Train a network on batches of crops."""
    fit_network(
        network,
        lambda _: _losses(network, batches.draw(config.batch), config),
        steps=config.steps,
        rate=config.rate,
        decay=config.decay,
        progress=progress,
    )


def _losses(
    network: TrainableFrontierNetwork, batch: _Batch, config: FrontierNetworkConfig
) -> tuple[torch.Tensor, torch.Tensor]:
    """All losses, weighted, and that of "closed"."""
    crops, closed, area, truth = batch
    shares, cells = _shares(crops), torch.from_numpy(np.ascontiguousarray(truth)).long()
    hidden = network.hidden(shares)
    found, drawn = network.layers["judge"](hidden["weigh"]), network.drawing(hidden)
    wanted = torch.from_numpy(
        np.stack([closed, closed & (area < LITTLE_LEFT), np.log1p(area)], 1).astype(np.float32)
    )
    wrong = functional.binary_cross_entropy_with_logits(found[:, :2], wanted[:, :2], reduction="none").mean(0)
    off = functional.smooth_l1_loss(found[:, 2], wanted[:, 2])
    hidden_cells = torch.clamp((cells != KNOWN).sum(), min=1)
    misdrawn = functional.cross_entropy(drawn, cells, ignore_index=KNOWN, reduction="sum") / hidden_cells
    loss = (
        wrong[0]
        + config.leftover_weight * wrong[1]
        + config.area_weight * off
        + config.drawing_weight * misdrawn
    )
    return loss, wrong[0]


def _shares(crops: Bytes) -> torch.Tensor:
    """Crops as layers take them (n, PLANES, SIDE, SIDE), 0..1."""
    return torch.from_numpy(np.ascontiguousarray(crops)).permute(0, 3, 1, 2).float() / 255.0


def quantised_weights(network: TrainableFrontierNetwork, crops: Bytes) -> dict[str, NDArray[np.generic]]:
    """Weights of a `FrontierNetwork`: every channel's as whole numbers up to 127, with scales.

    Args:
        network: What has been learnt.
        crops: uint8 (n, SIDE, SIDE, PLANES), of which some tell how large the numbers between layers get.
    """
    weights, unit = plain_weights(dict(network.layers.items())), 1.0 / 255.0
    out: dict[str, NDArray[np.generic]] = {}
    with torch.no_grad():
        between = network.hidden(_shares(crops))
    for name in LAYERS:
        weight, bias = weights[f"{name}.weight"], weights[f"{name}.bias"]
        largest = np.maximum(np.abs(weight).max(axis=0), 1e-12)
        after = (
            max(float(np.percentile(between[name].numpy(), RARE)), 1e-6) / MOST if name in between else 1.0
        )
        out[f"{name}.weight"] = np.rint(weight / largest * MOST).astype(np.int8)
        out[f"{name}.scale"] = (largest / MOST * unit / after).astype(np.float32)
        out[f"{name}.bias"] = (bias / after).astype(np.float32)
        unit = after
    return out
