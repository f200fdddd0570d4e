"""Layers of small networks as they are trained, and the training loop; needs torch."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import torch
from torch import nn
from torch.nn import functional

from layoutexplore.agents.rl.networks.training_state import optimizer_tensors, restore_optimizer
from layoutexplore.agents.rl.torch_policy_files import save_tensors
from layoutexplore.errors import ConfigError
from layoutexplore.files.tensors import read_tensors
from layoutexplore.grids.arrays import Floats32
from layoutexplore.models.convolution import halved

StepProgress = Callable[[int, int, float], None]
"""(steps made, steps in all, mean loss of late) -> None."""

_LATE = 100
"""Steps that the mean loss of late is taken over."""

_KEPT = 500
"""After so many steps the state of a training is kept."""


def fit_network(
    network: nn.Module,
    losses: Callable[[int], tuple[torch.Tensor, torch.Tensor]],
    *,
    steps: int,
    rate: float,
    decay: float,
    progress: StepProgress,
    kept: Path | None = None,
    device: str = "cpu",
) -> None:
    """Train a network by AdamW; the learning rate rises for a tenth of the steps and then falls (one cycle).

    Args:
        network: What is trained; it is ready to be asked afterwards.
        losses: Draws the batch of a step and gives the loss to descend and the one to show.
        steps: Batches.
        rate: Highest learning rate.
        decay: Of the weights.
        progress: Receives the steps.
        kept: File (safetensors) that the state is kept in now and then, and that a training that was stopped
            goes on from; the same result comes of it where what `losses` draws depends on the step alone.
        device: Where it is trained ("cpu" or "cuda"); afterwards it is on the processor.
    """
    network.to(device)
    optimizer = torch.optim.AdamW(network.parameters(), lr=rate, weight_decay=decay)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, rate, total_steps=steps, pct_start=0.1)
    network.train().to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    first = _take_up(kept, network, optimizer, steps) if kept and kept.exists() else 0
    if first:
        schedule.load_state_dict({"last_epoch": first - 1, "_step_count": first + 1})
        schedule.step()
    late = 0.0
    for step in range(first, steps):
        loss, shown = losses(step)
        optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        optimizer.step()
        schedule.step()
        late += (float(shown.detach()) - late) / min(step - first + 1, _LATE)
        progress(step + 1, steps, late)
        if kept and ((step + 1) % _KEPT == 0 or step + 1 == steps):
            _keep(kept, network, optimizer, step + 1, steps)
    network.cpu().eval()


def _keep(kept: Path, network: nn.Module, optimizer: torch.optim.Optimizer, step: int, steps: int) -> None:
    tensors = {f"network.{name}": values for name, values in network.state_dict().items()}
    tensors |= optimizer_tensors(optimizer)
    save_tensors(kept, tensors, {"step": str(step), "steps": str(steps)})


def _take_up(kept: Path, network: nn.Module, optimizer: torch.optim.Optimizer, steps: int) -> int:
    """Put a kept state in place and return its step.

    Raises:
        ConfigError: It is damaged, of another network or of a training of another length.
    """
    shapes = {f"network.{name}": tuple(values.shape) for name, values in network.state_dict().items()}
    tensors, told = read_tensors(kept, shapes, error=ConfigError, what="kept training")
    if told.get("steps") != str(steps) or not told.get("step", "").isdecimal():
        raise ConfigError(f"{kept}: kept of a training of other steps than {steps}: name another folder")
    found = {name: torch.from_numpy(values.copy()) for name, values in tensors.items()}
    restore_optimizer(optimizer, found, kept, ConfigError)
    network.load_state_dict({name.removeprefix("network."): found[name] for name in shapes})
    return int(told["step"])


class Convolution(nn.Module):
    """A convolution, normalised over the batch, and a ReLU."""

    def __init__(self, inputs: int, outputs: int, side: int, stride: int) -> None:
        super().__init__()
        self.linear = nn.Conv2d(inputs, outputs, side, stride, side // 2, bias=False)
        self.norm = nn.BatchNorm2d(outputs)

    def forward(self, values: torch.Tensor) -> torch.Tensor:
        """What the layer finds (batch, outputs, rows, cols) for values (batch, inputs, rows, cols)."""
        return functional.relu(self.norm(self.linear(values)))


class JudgingNetwork(nn.Module):
    """Convolutions by name, and a last layer `judge` without norm; children say how they follow each other.

    Args:
        shapes: The arguments of each convolution by its name, those of the last layer last.
    """

    def __init__(self, shapes: Mapping[str, tuple[int, int, int, int]]) -> None:
        super().__init__()
        *hidden, last = shapes
        self.layers = nn.ModuleDict({name: Convolution(*shapes[name]) for name in hidden})
        self.judge = nn.Conv2d(shapes[last][0], shapes[last][1], 1)

    def halved(self, full: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Values (batch, channels, rows, cols) at a half, a fourth and an eighth of their resolution."""
        return halved(lambda name, values: self.layers[name](values), full)

    def weights(self) -> dict[str, Floats32]:
        """The weights as the network that ships takes them."""
        return plain_weights({**self.layers, "judge": self.judge})


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
