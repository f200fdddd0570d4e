"""Networks while they are trained: the device that they are on, and their optimizer as tensors of a file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import torch

from layoutexplore.errors import ConfigError, shortened
from layoutexplore.files.reading import Kind

_PREFIX = "optimizer."


def chosen_device(device: str) -> str:
    """Where networks are trained: "cpu" or "cuda".

    Args:
        device: One of these, or "auto" for "cuda" where there is one.

    Raises:
        ConfigError: There is no such device.
    """
    there = torch.cuda.is_available()
    if device not in ("auto", "cpu", "cuda"):
        raise ConfigError(f"device must be auto, cpu or cuda, got {shortened(device)}")
    if device == "cuda" and not there:
        raise ConfigError("there is no CUDA device here: device must be cpu or auto")
    return "cuda" if there and device != "cpu" else "cpu"


def optimizer_tensors(optimizer: torch.optim.Optimizer) -> dict[str, torch.Tensor]:
    """What an optimizer remembers of the steps, by "optimizer.INDEX.KEY" with the index of the parameter."""
    return {
        f"{_PREFIX}{index}.{key}": torch.as_tensor(value)
        for index, parts in optimizer.state_dict()["state"].items()
        for key, value in parts.items()
    }


def restore_optimizer(
    optimizer: torch.optim.Optimizer, tensors: Mapping[str, torch.Tensor], path: Path, error: Kind
) -> None:
    """Let an optimizer remember the tensors of a file that have names of `optimizer_tensors`.

    Args:
        optimizer: Of the same parameters.
        tensors: By name; others are passed over.
        path: The file, for messages.
        error: What is raised.

    Raises:
        LayoutExploreError: Of the kind `error`, before anything has changed: a tensor is neither as large as
            its parameter nor a single number, or one is missing.
    """
    shapes = [p.shape for group in optimizer.param_groups for p in group["params"]]
    state: dict[int, dict[str, torch.Tensor]] = {}
    for name, tensor in tensors.items():
        if name.startswith(_PREFIX):
            index, _, key = name.removeprefix(_PREFIX).partition(".")
            number = int(index) if index.isascii() and index.isdigit() and len(index) < 9 else len(shapes)
            if number >= len(shapes) or tensor.shape not in (shapes[number], ()):
                raise error(f"{path} is damaged: {shortened(name)} fits none of this run's weights")
            state.setdefault(number, {})[key] = tensor
    if len({frozenset(part) for part in state.values()}) > 1:
        raise error(f"{path} is damaged: the optimizer's state lacks a part")
    optimizer.load_state_dict({**optimizer.state_dict(), "state": state})
