"""Layers of small networks as they are trained; needs torch."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn
from torch.nn import functional


class Convolution(nn.Module):
    """A convolution, normalised over the batch, and a ReLU."""

    def __init__(self, inputs: int, outputs: int, side: int, stride: int) -> None:
        super().__init__()
        self.linear = nn.Conv2d(inputs, outputs, side, stride, side // 2, bias=False)
        self.norm = nn.BatchNorm2d(outputs)

    def forward(self, values: torch.Tensor) -> torch.Tensor:
        """What the layer finds (batch, outputs, rows, cols) for values (batch, inputs, rows, cols)."""
        return functional.relu(self.norm(self.linear(values)))


def plain_weights(layers: Mapping[str, nn.Module]) -> dict[str, NDArray[np.float32]]:
    """The weights of layers as `layoutexplore.models.network_files` takes them: norms become part of the convolutions.

    Args:
        layers: Convolutions and linear layers (`Convolution`, `nn.Conv2d`, `nn.Linear`) by name.
    """
    out: dict[str, NDArray[np.float32]] = {}
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
        weight = weight.reshape(*weight.shape[:2], -1).permute(
            2, 1, 0
        )  # A linear layer is a kernel of one cell.
        out[f"{name}.weight"] = weight.reshape(-1, weight.shape[2]).contiguous().numpy()
        out[f"{name}.bias"] = bias.numpy()
    return out
