"""Hyper-parameters as data: files, flags, and what is wrong with them."""

from __future__ import annotations

import dataclasses
import tomllib
from pathlib import Path
from typing import Any

import pytest

from layoutexplore.agents.rl.hyperparameters import DEFAULTS, algorithms, read_config
from layoutexplore.envs.curriculum import PlanSampler
from layoutexplore.errors import ConfigError, UnknownNameError
from layoutexplore.files import to_toml
from layoutexplore.options import from_table


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
        ('algorithm = "sac"', r"unknown algorithm of .*\.toml: 'sac'"),
        ("algorithm = 5", r"unknown algorithm of .*\.toml: 5; known"),
        ('[network]\nencoder = "lstm"', "unknown network.encoder 'lstm'"),
        ("[network]\nheads = 5", "heads must divide"),
        ("steps = 1.5", "steps .* must be a whole number, got 1.5"),
        ("steps = 0", "steps must be a whole number from 1 to"),
        ("plans = []", "at least one of plans"),
        ('plans = [""]', "no plan is ''"),
        ('[evaluation]\nplans = ["test", ""]', "evaluation.plans must name floor plans"),
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


WRONG_VALUES = {
    "ppo": {
        "steps": ("0", "-1", "1_000_000_000_000"),
        "workers": ("-1", "1_000_000_000_000"),
        "environment": ('"CartPole-v1"', '"LayoutExplore/Frontier-v0"'),
        "sensors": ('["nonsense"]',),
        "max_steps": ("-1", "1_000_000_000_000"),
        "learning.n_steps": ("0", "-1", "1_000_000_000_000"),
        "learning.batch_size": ("0", "1", "-1", "1_000_000_000_000"),
        "learning.n_epochs": ("0", "-1", "1_000_000_000_000"),
        "learning.learning_rate": ("0.0", "-1.0", "nan", "inf", "1e9"),
        "learning.gamma": ("-0.1", "1.1", "nan"),
        "learning.gae_lambda": ("-0.1", "1.1"),
        "learning.clip_range": ("0.0", "-0.2", "inf"),
        "learning.ent_coef": ("-0.1", "inf"),
        "learning.vf_coef": ("-0.1", "inf"),
        "learning.max_grad_norm": ("0.0", "-1.0", "inf"),
        "generator.area": ("[600.0, 150.0]", "[-5.0, 5.0]", "[150.0, 1e9]"),
        "generator.clutter": ("[-0.1, 0.1]", "[0.0, 1.5]"),
        "generator.door_width": ("[0.0, 0.0]",),
        "evaluation.plans": ("[]",),
        "evaluation.references": ('["tour"]',),
        "evaluation.starts": ("0", "-1", "1_000_000_000_000"),
        "evaluation.every": ("0", "-1", "1_000_000_000_000"),
    },
    "dqn": {
        "learning.buffer_size": ("0", "-1", "1_000_000_000_000"),
        "learning.train_freq": ("0", "-1"),
        "learning.gradient_steps": ("-2",),
        "learning.exploration_fraction": ("0.0", "2.0"),
        "learning.exploration_final_eps": ("-0.1", "1.1"),
    },
    "maskable-ppo": {
        "envs": ("0", "-1", "1_000_000"),
        "learning.target_kl": ("0.0", "-1.0", "inf"),
        "network.width": ("4096",),
        "observation.max_frontiers": ("0", "1_000_000"),
        "reward.weight_95": ("-1.0", "inf"),
        "tour.area_exponent": ("-1.0", "1e300"),
        "imitation.learning_rate": ("0.0", "-1.0", "inf"),
        "imitation.rounds": ("0", "1_000_000_000_000"),
    },
    "tour-search": {
        "search.round": ("0", "-4", "4_000_000_000_000"),
        "search.spread": ("0.0", "1e300"),
        "search.outlier": ("0.0", "inf"),
    },
}


@pytest.mark.parametrize(
    ("algorithm", "key"), [(algorithm, key) for algorithm, keys in WRONG_VALUES.items() for key in keys]
)
def test_what_makes_no_sense_is_told_by_its_key(tmp_path: Path, algorithm: str, key: str) -> None:
    table, _, name = key.rpartition(".")
    head = f"[{table}]\nlayers = 64\n" if key == "network.width" else f"[{table}]\n" if table else ""
    for value in WRONG_VALUES[algorithm][key]:
        with pytest.raises(ConfigError, match=rf"(?s){name}.*\d|{name}.*got|unknown") as told:
            read_config(written(tmp_path, f'algorithm = "{algorithm}"\n{head}{name} = {value}'))
        assert name.rstrip("s") in str(told.value), value


def test_weights_of_the_reward_that_are_all_0(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="both 0: one must be above"):
        read_config(written(tmp_path, "[reward]\nweight_95 = 0.0\nweight_99 = 0.0"))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"algorithm": "pppo"}, "did you mean 'ppo'"),
        ({"learning": {}}, r"\[learning\]: missing learning_rate"),
        ({"learning": None}, "learning must be a Mapping"),
        ({"network": None}, "network must be a NetworkConfig"),
        ({"plans": (3,)}, "plans must be a list of names"),
        ({"evaluation": {}}, "evaluation must be an? EvaluationConfig"),
        ({"predictor": 3}, "predictor must be a text"),
    ],
)
def test_configurations_made_by_hand(changes: dict[str, Any], message: str) -> None:
    config = read_config(None, {"algorithm": "maskable-ppo"})
    with pytest.raises(ConfigError, match=message):
        dataclasses.replace(config, **changes)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot read the configuration"):
        read_config(tmp_path / "none.toml")


def test_an_unknown_flag() -> None:
    with pytest.raises(UnknownNameError, match="unknown hyper-parameter"):
        read_config(None, {"speed": 1})


def test_all_of_the_generator_can_be_set(tmp_path: Path) -> None:
    path = tmp_path / "growing.toml"
    path.write_text(
        "algorithm = 'maskable-ppo'\nplans = ['generated']\n[generator]\narea = [200, 900]\n"
        "first_area = 300\ngrowth = 0.5\nshipped = ['validation']\nfamilies = { office = 2, school = 1 }\n"
    )
    config = read_config(path)
    sampler = from_table(PlanSampler, config.generator, "[generator]")
    assert sampler.families == {"office": 2, "school": 1} and sampler.shipped == ("validation",)
    assert (sampler.first_area, sampler.growth) == (300.0, 0.5)
    assert {field.name for field in dataclasses.fields(PlanSampler)} == set(config.generator)
    path.write_text("algorithm = 'maskable-ppo'\nplans = ['generated']\n[generator.families]\noffices = 1\n")
    with pytest.raises(UnknownNameError, match="office"):
        read_config(path)
