"""What the tests of learned policies share: decisions to look at, small configurations, and a watcher."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch

from layoutexplore.agents.rl.card import PolicySpec, spec_of
from layoutexplore.agents.rl.hyperparameters import TrainingConfig, merge, read_config
from layoutexplore.agents.rl.networks.actor_critic import Actor
from layoutexplore.envs.observation import FRONTIER_FEATURES, ROBOT_FEATURES
from layoutexplore.files import to_toml

SLOTS = 12

SMALL: dict[str, Any] = {
    "algorithm": "maskable-ppo",
    "steps": 64,
    "envs": 2,
    "workers": 1,
    "sensors": ["indoor"],
    "plans": ["apartment-01"],
    "predictor": "none",
    "checkpoint_every": 32,
    "critic_steps": 16,
    "averaging": 0.8,
    "network": {"width": 8, "layers": 1, "heads": 2},
    "learning": {"n_steps": 8, "batch_size": 8, "n_epochs": 2},
    "evaluation": {"every": 32, "plans": ["apartment-01"], "starts": 1, "references": ["nearest"]},
}

SMALL_SEARCH: dict[str, Any] = {
    "algorithm": "tour-search",
    "steps": 12,
    "predictor": "none",
    "workers": 1,
    "sensors": ["indoor"],
    "generator": {"area": [100.0, 110.0]},
    "search": {"round": 8, "pairs": 2},
    "evaluation": {"every": 8, "plans": ["apartment:900006"], "starts": 1, "references": ["nearest"]},
}


class Silent:
    """A watcher that remembers what it was told."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.steps = 0

    def say(self, text: str) -> None:
        self.lines.append(text)

    def advance(self, steps: int, total: int) -> None:
        self.steps = steps


def train(
    config: TrainingConfig, folder: Path, *, resume: bool = False, watcher: Silent | None = None
) -> Any:
    """A whole run in a folder."""
    from layoutexplore.agents.rl.tour_search.search import SearchRun
    from layoutexplore.agents.rl.training import Run

    make = SearchRun if config.search else Run
    run = make(config, folder, device="cpu", resume=resume, watcher=watcher or Silent())
    run.train()
    return run


def write_config(path: Path, **changes: Any) -> Path:
    """The small configuration, with some tables changed, as a file."""
    table = dict(SMALL)
    for key, value in changes.items():
        table[key] = {**table.get(key, {}), **value} if isinstance(value, dict) else value
    path.write_text(to_toml(table))
    return path


def small_config(tmp_path: Path, **changes: Any) -> TrainingConfig:
    return read_config(write_config(tmp_path / "small.toml", **changes))


def spec(encoder: str = "attention", maps: bool = False) -> PolicySpec:
    config = read_config(None, {"algorithm": "maskable-ppo", "predictor": "none"})
    table = merge(
        config.as_table(),
        {"network": {"encoder": encoder, "width": 16}, "observation": {"global_map": maps}},
        "here",
    )
    network = type(config.network)(**table["network"])  # type: ignore[misc]
    return spec_of(
        TrainingConfig(**{**vars(config), "network": network, "observation": table["observation"]})
    )


def random_actor(encoder: str = "attention", seed: int = 0, maps: bool = False) -> Actor:
    """An actor that says something of everything."""
    torch.manual_seed(seed)
    actor = Actor(spec(encoder, maps))
    with torch.no_grad():
        for parameter in actor.parameters():
            parameter.add_(0.3 * torch.randn_like(parameter))
    return actor.eval()


def observations(
    counts: list[int], seed: int = 0, slots: int = SLOTS, maps: bool = False
) -> dict[str, torch.Tensor]:
    """Random observations with that many frontiers."""
    rng = np.random.default_rng(seed)
    table = rng.normal(size=(len(counts), slots, len(FRONTIER_FEATURES))).astype(np.float32)
    table[..., list(FRONTIER_FEATURES).index("valid")] = 1.0
    for row, count in zip(table, counts, strict=True):
        row[count:] = 0.0
    mask = np.concatenate(
        [np.arange(slots) < np.array(counts)[:, None], np.ones((len(counts), 1), np.bool_)], axis=1
    )
    arrays = {
        "frontiers": table.reshape(len(counts), -1),
        "robot": rng.normal(size=(len(counts), len(ROBOT_FEATURES))).astype(np.float32),
        "action_mask": mask.astype(np.int8),
    }
    if maps:
        arrays["global_map"] = rng.integers(0, 256, (len(counts), 7, 84, 84)).astype(np.uint8)
    return {name: torch.from_numpy(array) for name, array in arrays.items()}
