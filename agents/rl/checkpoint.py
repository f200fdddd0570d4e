"""Checkpoints of training: one safetensors file with weights, optimizer and counters; nothing is pickled.

The file is written beside its place and then renamed, so that a kill at any moment leaves the last whole one.
Random states need not be kept: what follows a checkpoint is seeded anew, by the run's seed and the steps
done.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

import torch
from stable_baselines3.common.base_class import BaseAlgorithm

from layoutexplore.agents.rl.evaluation import EVALUATION
from layoutexplore.agents.rl.networks.training_state import optimizer_tensors, restore_optimizer
from layoutexplore.agents.rl.torch_policy_files import save_tensors
from layoutexplore.errors import ResultsError, cause, checks_arguments
from layoutexplore.files import parse_json
from layoutexplore.files.reading import is_there
from layoutexplore.files.schema import Flag, Items, Number, Record, Text
from layoutexplore.files.tensors import read_tensors

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
        imitated: Whether the policy has learnt from its teacher, which comes before all steps.
        format: Version of the format.
    """

    algorithm: str
    steps: int = 0
    updates: int = 0
    calls: int = 0
    seconds: float = 0.0
    evaluations: list[dict[str, float]] = field(default_factory=list)
    imitated: bool = False
    format: int = FORMAT


@checks_arguments
def save_checkpoint(folder: Path, model: BaseAlgorithm, progress: Progress) -> None:
    """Write the state of a run."""
    tensors = {f"policy.{name}": tensor for name, tensor in model.policy.state_dict().items()}
    tensors |= optimizer_tensors(model.policy.optimizer)
    save_tensors(folder / FILE, tensors, {"progress": json.dumps(asdict(progress))})


@checks_arguments
def load_checkpoint(folder: Path, model: BaseAlgorithm) -> Progress:
    """Put the state of a run into a model that was built from the same configuration.

    Raises:
        ResultsError: There is no checkpoint, it is damaged, or it belongs to another configuration or
            version.
    """
    path = folder / FILE
    if not is_there(path):
        raise ResultsError(f"no checkpoint {path}: leave out --resume to start a run there")
    arrays, metadata = read_tensors(path, what="checkpoint")
    progress = _progress(metadata, path)
    if progress.format != FORMAT or progress.algorithm != type(model).__name__:
        raise ResultsError(
            f"{path} is a checkpoint of {progress.algorithm} in format {progress.format}; "
            f"this run needs {type(model).__name__} in format {FORMAT}: start again in another folder"
        )
    tensors = {name: torch.from_numpy(values.copy()) for name, values in arrays.items()}
    policy = {k.removeprefix("policy."): t for k, t in tensors.items() if k.startswith("policy.")}
    shapes = {name: values.shape for name, values in model.policy.state_dict().items()}
    if shapes != {name: values.shape for name, values in policy.items()}:
        raise ResultsError(f"{path} does not fit this run's network, or is damaged")
    restore_optimizer(model.policy.optimizer, tensors, path, ResultsError)
    model.policy.load_state_dict(policy)
    model.num_timesteps = progress.steps
    for name, value in (("_n_updates", progress.updates), ("_n_calls", progress.calls)):
        if hasattr(model, name):
            setattr(model, name, value)
    return progress


_COUNT = Number(low=0, high=1e15, whole=True)
_STEPS = Number(low=0, high=1e12, whole=True)
_PROGRESS = Record(
    {"algorithm": Text(most=200), "steps": _STEPS, "updates": _COUNT, "calls": _COUNT, "format": _COUNT},
    {"seconds": Number(low=0, high=1e15), "evaluations": Items(EVALUATION, 0, 100_000), "imitated": Flag()},
)
"""What the header of a checkpoint must hold."""


def _progress(metadata: Mapping[str, str], path: Path) -> Progress:
    if "progress" not in metadata:
        raise ResultsError(f"{path} is not a checkpoint of layoutexplore train: its header has no progress")
    table = parse_json(
        metadata["progress"], f"{path} is damaged: its progress", _PROGRESS, error=ResultsError
    )
    try:
        return Progress(**table)
    except TypeError as error:
        raise ResultsError(f"{path} is damaged: its progress: {cause(error)}") from error
