"""Training the separator network."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import astuple, replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from layoutexplore.cli import app
from layoutexplore.errors import ConfigError
from layoutexplore.layout.merging.separator.network import BORDER, LAYERS, SeparatorNetwork
from layoutexplore.models.network_files import load_weights, shapes_of
from layoutexplore.training.separator.examples import separator_example
from tests.layout.merging.cases import plan, rooms_of

torch = pytest.importorskip("torch")


def test_training_learns_where_rooms_end() -> None:
    from layoutexplore.training.separator.network import SeparatorTrainingConfig, fit_separator
    from layoutexplore.training.separator.targets import as_input, targets_of

    example = separator_example(plan(), rooms_of(plan()), 0.05)
    config = SeparatorTrainingConfig(steps=60, batch=4, crop=24)
    told: list[tuple[int, int, float]] = []
    weights = fit_separator([example], config, lambda *args: told.append(args)).weights()
    assert len(told) == 60 and told[-1][2] < 0.7 * told[0][2]
    parts = [torch.from_numpy(part[None]) for part in astuple(example)]
    values = np.moveaxis(as_input(parts[0])[0].numpy(), 0, 2)
    odds = SeparatorNetwork(weights).forward(np.ascontiguousarray(values))[..., BORDER]
    truth, weight = (part[0, BORDER].numpy() for part in targets_of(*parts))
    right = (odds > 0) == (truth > 0)
    assert right[weight > 0].mean() > 0.85
    short = replace(config, steps=3)
    once, again = (fit_separator([example], short, lambda *_: None).weights() for _ in range(2))
    assert all(np.array_equal(once[name], again[name]) for name in weights), "the same seed, the same network"
    with pytest.raises(ConfigError, match="no map"):
        fit_separator([], config, lambda *_: None)


def test_a_stopped_training_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from layoutexplore.training import torch_layers
    from layoutexplore.training.separator.network import SeparatorTrainingConfig, fit_separator

    monkeypatch.setattr(torch_layers, "_KEPT", 3)
    example, kept = separator_example(plan(), rooms_of(plan()), 0.05), tmp_path / "state.safetensors"
    config = SeparatorTrainingConfig(steps=8, batch=2, crop=16)
    whole = fit_separator([example], config, lambda *_: None).weights()

    def stop(done: int, *_: object) -> None:
        if done == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fit_separator([example], config, stop, kept)
    told: list[int] = []
    resumed = fit_separator([example], config, lambda done, *_: told.append(done), kept).weights()
    assert told == [4, 5, 6, 7, 8]
    assert all(np.allclose(whole[name], resumed[name], atol=1e-6) for name in whole)
    with pytest.raises(ConfigError, match="other steps than 9"):
        fit_separator([example], replace(config, steps=9), stop, kept)


def test_workers_change_nothing(tmp_path: Path) -> None:
    from layoutexplore.training.separator.maps import separator_examples
    from layoutexplore.training.separator.network import SeparatorTrainingConfig, fit_separator

    alone = separator_examples(2)
    shared = separator_examples(2, workers=2)
    pairs = zip(alone, shared, strict=True)
    assert all(np.array_equal(*both) for a, b in pairs for both in zip(astuple(a), astuple(b), strict=True))
    config = SeparatorTrainingConfig(steps=3, batch=2, crop=16)
    once, again = (
        fit_separator(alone, replace(config, workers=count), lambda *_: None).weights() for count in (0, 2)
    )
    assert all(np.array_equal(once[name], again[name]) for name in once)
    with pytest.raises(ConfigError, match="device must be auto, cpu or cuda, got 'gpu'"):
        fit_separator(alone, replace(config, device="gpu"), lambda *_: None)


KILLING = """
import multiprocessing
from layoutexplore.errors import WorkerError
from layoutexplore.training.separator.examples import separator_example
from layoutexplore.training.separator.network import SeparatorTrainingConfig, fit_separator
from tests.layout.merging.cases import plan, rooms_of

def kill(step, steps, loss):
    if step == 1:
        multiprocessing.active_children()[0].kill()

config = SeparatorTrainingConfig(steps=100_000, batch=2, crop=16, workers=2)
try:
    fit_separator([separator_example(plan(), rooms_of(plan()), 0.05)], config, kill)
except WorkerError as error:
    print(error)
"""


def test_a_worker_that_is_killed_is_told() -> None:
    """In a process of its own: torch raises its error at whatever this one does when a worker ends."""
    told = subprocess.run(
        [sys.executable, "-c", KILLING], capture_output=True, text=True, check=False, timeout=120
    )
    assert re.match(r"one of 2 worker processes was killed .* --workers\)", told.stdout), told.stderr


def test_the_command_writes_a_network(tmp_path: Path) -> None:
    words = ["evaluate", "train-separator", "--simulated", "2", "--plans", "apartment-01", "--steps", "2"]
    words += ["--cache", str(tmp_path / "kept"), "--out", str(tmp_path / "network.safetensors")]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    load_weights(tmp_path / "network.safetensors", shapes_of(LAYERS))
    assert len(list((tmp_path / "kept").iterdir())) == 3, "two plans and the state"
    first = (tmp_path / "network.safetensors").read_bytes()
    assert CliRunner().invoke(app, [*words, "--batch", "2"]).exit_code == 0
    assert len(list((tmp_path / "kept").iterdir())) == 4, "another training does not go on with that state"
    assert (tmp_path / "network.safetensors").read_bytes() != first
