"""Training the network that classifies cells (`layoutexplore evaluate train-predictor`); needs torch.

First it learns from generated plans, of which there are as many as one likes; then from those and from real
ones. Every decision is shown in all of the eight orientations of a grid.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch.nn import functional

from layoutexplore.grids.arrays import Floats32
from layoutexplore.predictors.cell_model.network import LAYERS
from layoutexplore.predictors.cell_model.network_input import PLANES, draw_planes, reoriented
from layoutexplore.training.predictor_samples import CellNetworkSample
from layoutexplore.training.torch_layers import JudgingNetwork, StepProgress, fit_network


@dataclass(frozen=True, kw_only=True)
class CellNetworkConfig:
    """How the network is trained.

    Attributes:
        first_steps: Steps on generated plans alone, the same for all folds of buildings.
        steps: Steps on all plans.
        generated_share: Share of the scenes of generated plans in the latter.
        first_rate, rate: Highest learning rates; they rise for a tenth of the steps and then fall.
        batch: Scenes a step.
        crop: Side in lattice cells of the crop of a scene.
        region_cells: A region's lattice cells count as so many at most.
        seed: Of the weights and the draws.
    """

    first_steps: int = 7000
    steps: int = 3500
    generated_share: float = 0.4
    first_rate: float = 3e-3
    rate: float = 2e-3
    batch: int = 8
    crop: int = 80
    region_cells: int = 120
    seed: int = 0


class TrainableCellNetwork(JudgingNetwork):
    """The network of `CellNetwork` with what training needs besides."""

    def __init__(self) -> None:
        super().__init__(LAYERS)

    def forward(self, planes: torch.Tensor) -> torch.Tensor:
        """Log-odds (batch, 2, rows, cols) for planes (batch, PLANES, rows, cols)."""
        layers = self.layers
        full = layers["at_full"](layers["show"](planes))
        half, fourth, low = self.halved(full)
        low = layers["wide"](low)
        for name, skipped in (("up_to_fourth", fourth), ("up_to_half", half), ("up_to_full", full)):
            larger = functional.interpolate(low, scale_factor=2)[..., : skipped.shape[2], : skipped.shape[3]]
            low = layers[name](torch.cat([larger, skipped], 1))
        found: torch.Tensor = self.judge(layers["end"](low))
        return found


def pretrain_cell_network(
    generated: Sequence[CellNetworkSample], config: CellNetworkConfig, progress: StepProgress
) -> TrainableCellNetwork:
    """A network that has learnt from generated plans, if there are any."""
    torch.manual_seed(config.seed)
    network = TrainableCellNetwork()
    if generated:
        _train(network, generated, (), config.first_steps, config.first_rate, config, progress)
    return network


def train_cell_network(
    first: TrainableCellNetwork,
    generated: Sequence[CellNetworkSample],
    real: Sequence[CellNetworkSample],
    config: CellNetworkConfig,
    progress: StepProgress,
) -> dict[str, Floats32]:
    """The weights of a network that goes on learning from all plans; the first one stays as it is."""
    network = TrainableCellNetwork()
    network.load_state_dict(first.state_dict())
    _train(network, generated, real, config.steps, config.rate, config, progress)
    return network.weights()


def _train(
    network: TrainableCellNetwork,
    generated: Sequence[CellNetworkSample],
    real: Sequence[CellNetworkSample],
    steps: int,
    rate: float,
    config: CellNetworkConfig,
    progress: StepProgress,
) -> None:
    rng = np.random.default_rng(config.seed)

    def losses(_: int) -> tuple[torch.Tensor, torch.Tensor]:
        chosen = []
        for _ in range(config.batch):
            pool = generated if not real or (generated and rng.random() < config.generated_share) else real
            chosen.append(pool[int(rng.integers(len(pool)))])
        planes, truth, weight = _batch(chosen, config, rng)
        wrong = functional.binary_cross_entropy_with_logits(network(planes), truth, reduction="none")
        # A crop may hold nothing that is asked.
        loss = (wrong * weight).sum() / weight.sum().clamp(min=1.0)
        return loss, loss

    fit_network(network, losses, steps=steps, rate=rate, decay=1e-3, progress=progress)


def _batch(
    samples: Sequence[CellNetworkSample], config: CellNetworkConfig, rng: np.random.Generator
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Planes (batch, PLANES, crop, crop), truth and weights (batch, 2, crop, crop).

    Each sample takes a random orientation.
    """
    size = config.crop
    planes = np.zeros((len(samples), size, size, PLANES), np.float32)
    truth, weight = (np.zeros((len(samples), 2, size, size), np.float32) for _ in range(2))
    for k, sample in enumerate(samples):
        scene = reoriented(sample.scene, int(rng.integers(8)))
        low = np.maximum(scene.lattice_cells.min(axis=0).astype(int) - 1, 0)
        spare = np.maximum(scene.lattice_cells.max(axis=0) + 2 - size, low)
        corner = rng.integers(low, spare + 1).tolist()
        drawn = draw_planes(scene, (corner[0], corner[1]), size)
        planes[k, : drawn.values.shape[0], : drawn.values.shape[1]] = drawn.values
        asked = drawn.asked
        at = (
            k,
            scene.rank[asked],
            scene.lattice_cells[asked, 0] - drawn.row,
            scene.lattice_cells[asked, 1] - drawn.col,
        )
        truth[at] = sample.inside[asked]
        count = np.bincount(scene.region)[scene.region[asked]]
        weight[at] = np.minimum(1.0, config.region_cells / count)
    shown = torch.from_numpy(planes).permute(0, 3, 1, 2)
    return shown, torch.from_numpy(truth), torch.from_numpy(weight)
