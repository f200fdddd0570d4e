"""Layers of small networks as they are trained, and the training loop; needs torch."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import torch
from torch import nn
from torch.nn import functional

from layoutexplore.grids.arrays import Floats32

StepProgress = Callable[[int, int, float], None]
"""(steps made, steps in all, mean loss of late) -> None."""

_LATE = 100
"""Steps that the mean loss of late is taken over."""


def fit_network(
    network: nn.Module,
    losses: Callable[[], tuple[torch.Tensor, torch.Tensor]],
    *,
    steps: int,
    rate: float,
    decay: float,
    progress: StepProgress,
) -> None:
    """Train a network by AdamW; the learning rate rises for a tenth of the steps and then falls (one cycle).

    Args:
        network: What is trained; it is ready to be asked afterwards.
        losses: Draws a batch and gives the loss to descend and the one to show.
        steps: Batches.
        rate: Highest learning rate.
        decay: Of the weights.
        progress: Receives the steps.
    """
    optimizer = torch.optim.AdamW(network.parameters(), lr=rate, weight_decay=decay)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, rate, total_steps=steps, pct_start=0.1)
    network.train().to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    late = 0.0
    for step in range(steps):
        loss, shown = losses()
        optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        optimizer.step()
        schedule.step()
        late += (float(shown.detach()) - late) / min(step + 1, _LATE)
        progress(step + 1, steps, late)
    network.eval()


class Convolution(nn.Module):
    """A convolution, normalised over the batch, and a ReLU."""

    def __init__(self, inputs: int, outputs: int, side: int, stride: int) -> None:
        super().__init__()
        self.linear = nn.Conv2d(inputs, outputs, side, stride, side // 2, bias=False)
        self.norm = nn.BatchNorm2d(outputs)

    def forward(self, values: torch.Tensor) -> torch.Tensor:
        """What the layer finds (batch, outputs, rows, cols) for values (batch, inputs, rows, cols)."""
        return functional.relu(self.norm(self.linear(values)))


def plain_weights(layers: Mapping[str, nn.Module]) -> dict[str, Floats32]:
    """The weights of layers as network files hold them (`layoutexplore.models.network_files`).

    Norms become part of the convolutions.

    Args:
        layers: Convolutions and linear layers (`Convolution`, `nn.Conv2d`, `nn.Linear`) by name.
    """
    out: dict[str, Floats32] = {}
    for name, layer in layers.items():
        if isinstance(layer, Convolution):
            norm = layer.norm
            assert norm.running_mean is not None and norm.running_var is not None
            scale = norm.weight.detach() / torch.sqrt(norm.running_var + norm.eps)
            weight = layer.linear.weight.detach() * scale[:, None, None, None]
            bias = norm.bias.detach() - scale * norm.running_mean
        else:
            assert isinstance(layer, nn.Conv2d | nn.Linear) and layer.bias is not None
            weight, bias = layer.weight.detach(), layer.bias.detach()
        # A linear layer is a kernel of one cell.
        weight = weight.reshape(*weight.shape[:2], -1).permute(2, 1, 0)
        out[f"{name}.weight"] = weight.reshape(-1, weight.shape[2]).contiguous().numpy()
        out[f"{name}.bias"] = bias.numpy()
    return out
