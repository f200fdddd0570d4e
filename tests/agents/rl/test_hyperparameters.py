"""Hyper-parameters as data: files, flags, and what is wrong with them."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from layoutexplore.agents.rl.hyperparameters import DEFAULTS, algorithms, read_config
from layoutexplore.errors import ConfigError, UnknownNameError
from layoutexplore.files import to_toml


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "config.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("algorithm", algorithms())
def test_the_shipped_ones_make_a_configuration_that_survives_a_file(algorithm: str, tmp_path: Path) -> None:
    config = read_config(None, {"algorithm": algorithm})
    assert read_config(written(tmp_path, to_toml(config.as_table()))) == config


def test_a_file_changes_the_shipped_ones_and_flags_win(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        'algorithm = "maskable-ppo"\nsteps = 7\nseed = 3\n'
        '[network]\nencoder = "deep-sets"\n[learning]\nlearning_rate = 1\n',
    )
    config = read_config(path, {"steps": 9, "envs": None, "plans": ["test"]})
    assert (config.steps, config.seed, config.plans) == (9, 3, ("test",))
    assert config.network is not None and config.network.encoder == "deep-sets"
    assert config.learning["learning_rate"] == 1.0 and isinstance(config.learning["learning_rate"], float)
    assert config.envs == tomllib.loads(DEFAULTS.read_text())["maskable-ppo"]["envs"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("stepps = 3", "unknown hyper-parameter of 'tour-search' in .*'stepps': did you mean 'steps'"),
        (
            'algorithm = "ppo"\n[learning]\nlearning_rat = 1e-3',
            r"\[learning\]: 'learning_rat': did you mean 'learning_rate'",
        ),
        ('algorithm = "dqn"\n[network]\nwidth = 8', "unknown hyper-parameter of 'dqn' in .*'network'"),
        ('algorithm = "sac"', "unknown algorithm 'sac'"),
        ('[network]\nencoder = "lstm"', "unknown network.encoder 'lstm'"),
        ("[network]\nheads = 5", "heads must divide"),
        ("steps = 1.5", "steps .* must be a whole number, got 1.5"),
        ("steps = 0", "steps must be a whole number, 1 or more"),
        ("plans = []", "at least one of plans"),
        ("plans = [3]", "plans .* must be a list of names"),
        ("[generator]\narea = [100]", "area .* must be a list of 2 numbers"),
        ('algorithm = "ppo"\nlearning = 3', "learning .* must be a table"),
        ('algorithm = "ppo"\n[learning]\ngamma = nan', "must be a finite number"),
        ("steps = ", "not valid TOML"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        read_config(written(tmp_path, text))


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot read the configuration"):
        read_config(tmp_path / "none.toml")


def test_an_unknown_flag() -> None:
    with pytest.raises(UnknownNameError, match="unknown hyper-parameter"):
        read_config(None, {"speed": 1})
