"""Weights of networks in files."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType

import numpy as np
import safetensors.numpy
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError, checks_arguments, shortened
from layoutexplore.files import write_atomically
from layoutexplore.files.tensors import check_shapes, read_tensors

Layers = Mapping[str, tuple[int, int, int, int]]
"""Channels in and out, side of the kernel and stride of each layer."""

Weights = Mapping[str, NDArray[np.floating]]
"""By name: "LAYER.weight" (side * side * channels in, channels out) and "LAYER.bias" (channels out,)."""


MOST_WEIGHT = 1e4
"""Weights of trained networks are below 200; with far larger ones no sum is finite."""


def shapes_of(layers: Layers) -> dict[str, tuple[int, ...]]:
    """The shapes of the weights of layers.

    Example:
        >>> shapes_of({"show": (5, 8, 3, 1)})
        {'show.weight': (45, 8), 'show.bias': (8,)}
    """
    shapes: dict[str, tuple[int, ...]] = {}
    for name, (inputs, outputs, side, _) in layers.items():
        shapes |= {f"{name}.weight": (side * side * inputs, outputs), f"{name}.bias": (outputs,)}
    return shapes


@checks_arguments
def save_weights(path: Path, weights: Mapping[str, NDArray[np.generic]], note: str) -> None:
    """Write weights.

    Args:
        path: The file (safetensors).
        weights: By name, in the types in which they are to be kept.
        note: What the network was trained on.

    Raises:
        MapError: The file cannot be written.
    """
    arrays = {name: np.ascontiguousarray(values) for name, values in weights.items()}
    write_atomically(path, safetensors.numpy.save(arrays, metadata={"note": note}))


@checks_arguments
def load_weights(
    path: Path, shapes: Mapping[str, tuple[int, ...]], what: str = "network of the predictor layout"
) -> Mapping[str, NDArray[np.float32]]:
    """Read weights; a file that has been read is kept until it changes.

    Args:
        path: The file.
        shapes: What it must hold.
        what: The network, in words.

    Returns:
        All as float32.

    Raises:
        ConfigError: There is no such file, it is damaged, or it is none that this version can run.
    """
    try:
        changed = path.stat().st_mtime_ns
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read as a {what}: {error}") from error
    weights = _read(path, what, changed)
    check_shapes(weights, shapes, path, ConfigError)
    return weights


@lru_cache(maxsize=16)
def _read(path: Path, what: str, _changed: int) -> Mapping[str, NDArray[np.float32]]:
    weights, _ = read_tensors(path, error=ConfigError, what=what)
    for name, values in weights.items():
        if values.dtype.kind == "f" and values.size and (most := float(np.abs(values).max())) > MOST_WEIGHT:
            raise ConfigError(
                f"{path}: {shortened(name)} holds {most:.3g}, and no weight of a {what} is above "
                f"{MOST_WEIGHT:g}: train it again"
            )
    return MappingProxyType(
        {name: np.ascontiguousarray(values, np.float32) for name, values in weights.items()}
    )
