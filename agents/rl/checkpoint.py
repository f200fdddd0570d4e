"""Checkpoints of training: one safetensors file with weights, optimizer and counters; nothing is pickled.

The file is written beside its place and then renamed, so that a kill at any moment leaves the last whole one.
Random states need not be kept: what follows a checkpoint is seeded anew, by the run's seed and the steps
done.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path

import safetensors.torch
import torch
from safetensors import SafetensorError, safe_open
from stable_baselines3.common.base_class import BaseAlgorithm

from layoutexplore.agents.rl.torch_policy_files import save_tensors
from layoutexplore.errors import ResultsError

FORMAT = 1
FILE = "checkpoint.safetensors"


@dataclass
class Progress:
    """How far a run is.

    Attributes:
        algorithm: Its algorithm.
        steps: Steps that the policy has learnt from.
        updates: Passes of the optimizer over the data.
        calls: Steps of the vector environment, which DQN counts.
        seconds: Seconds of training, without evaluations.
        evaluations: What each evaluation found, oldest first.
        format: Version of the format.
    """

    algorithm: str
    steps: int = 0
    updates: int = 0
    calls: int = 0
    seconds: float = 0.0
    evaluations: list[dict[str, float]] = field(default_factory=list)
    format: int = FORMAT


def save_checkpoint(folder: Path, model: BaseAlgorithm, progress: Progress) -> None:
    """Write the state of a run."""
    tensors = {f"policy.{name}": tensor for name, tensor in model.policy.state_dict().items()}
    for index, state in model.policy.optimizer.state_dict()["state"].items():
        tensors |= {f"optimizer.{index}.{key}": torch.as_tensor(value) for key, value in state.items()}
    save_tensors(folder / FILE, tensors, {"progress": json.dumps(asdict(progress))})


def load_checkpoint(folder: Path, model: BaseAlgorithm) -> Progress:
    """Put the state of a run into a model that was built from the same configuration.

    Raises:
        ResultsError: There is no checkpoint, it is damaged, or it belongs to another configuration or
            version.
    """
    path = folder / FILE
    progress = _read_header(path)
    if progress.format != FORMAT or progress.algorithm != type(model).__name__:
        raise ResultsError(
            f"{path} is a checkpoint of {progress.algorithm} in format {progress.format}; "
            f"this run needs {type(model).__name__} in format {FORMAT}: start again in another folder"
        )
    try:
        tensors = safetensors.torch.load_file(path)
        model.policy.load_state_dict(
            {k.removeprefix("policy."): t for k, t in tensors.items() if k.startswith("policy.")}
        )
    except (SafetensorError, RuntimeError) as error:
        raise ResultsError(f"{path} does not fit this run's network, or is damaged: {error}") from error
    _load_optimizer(model, tensors)
    model.num_timesteps = progress.steps
    for name, value in (("_n_updates", progress.updates), ("_n_calls", progress.calls)):
        if hasattr(model, name):
            setattr(model, name, value)
    return progress


def _read_header(path: Path) -> Progress:
    if not path.is_file():
        raise ResultsError(f"no checkpoint {path}: leave out --resume to start a run there")
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
        return Progress(**json.loads(metadata["progress"]))
    except (SafetensorError, KeyError, ValueError, TypeError, OSError) as error:
        raise ResultsError(
            f"{path} is not a checkpoint of layoutexplore train, or is damaged: {error}"
        ) from error


def _load_optimizer(model: BaseAlgorithm, tensors: dict[str, torch.Tensor]) -> None:
    state: dict[int, dict[str, torch.Tensor]] = {}
    for name, tensor in tensors.items():
        if name.startswith("optimizer."):
            _, index, key = name.split(".")
            state.setdefault(int(index), {})[key] = tensor
    groups = model.policy.optimizer.state_dict()["param_groups"]
    model.policy.optimizer.load_state_dict({"state": state, "param_groups": groups})
