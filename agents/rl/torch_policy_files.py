"""Policies on disk: writing the actor's weights with their card, and reading them back."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import safetensors.torch
import torch

from layoutexplore.agents.rl.card import PolicySpec, read_spec
from layoutexplore.agents.rl.networks.actor_critic import Actor
from layoutexplore.errors import ResultsError, checks_arguments
from layoutexplore.files import to_toml, write_atomically
from layoutexplore.files.tensors import read_tensors


@checks_arguments
def save_policy(
    path: str | os.PathLike[str], state: Mapping[str, torch.Tensor], card: Mapping[str, Any]
) -> None:
    """Write weights and card to a file, and the card beside it; a kill leaves the old file or the new one."""
    path = Path(path)
    text = to_toml(dict(card))
    save_tensors(path, state, {"card": text})
    write_atomically(path.with_suffix(".toml"), text)


@checks_arguments
def save_tensors(path: Path, tensors: Mapping[str, torch.Tensor], metadata: dict[str, str]) -> None:
    """A safetensors file, written beside its place and then moved there."""
    plain = {name: tensor.detach().cpu().contiguous().clone() for name, tensor in tensors.items()}
    # Not `save_file`: what that makes nobody but its owner may read.
    write_atomically(path, safetensors.torch.save(plain, metadata=metadata))


@checks_arguments
def load_actor(path: str | os.PathLike[str]) -> tuple[Actor, PolicySpec]:
    """The network of a policy's file, and its spec.

    Raises:
        ResultsError: The file is damaged, or is not a policy that this version can run.
    """
    path = Path(path)
    spec = read_spec(path)
    tensors, _ = read_tensors(path, what="policy")
    if (needed := spec.cost_feature) not in spec.frontier_features:
        raise ResultsError(
            f"{path}: the network that its card describes reads {needed}, but the card does not"
        )
    with torch.device("meta"):  # what the card describes may be much larger than what the file holds
        shapes = {name: tuple(values.shape) for name, values in Actor(spec).state_dict().items()}
    if shapes != {name: values.shape for name, values in tensors.items()}:
        raise ResultsError(f"{path}: the weights do not fit the network that its card describes")
    actor = Actor(spec)
    actor.load_state_dict({name: torch.from_numpy(values.copy()) for name, values in tensors.items()})
    return actor.eval(), spec
