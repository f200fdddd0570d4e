"""The benchmark's configuration: read from TOML, refused with its place, and what tells two of them apart."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from layoutexplore.benchmark.config import BenchmarkConfig, read_benchmark_config, simulation_of_file
from layoutexplore.errors import ConfigError
from layoutexplore.maps.library import load_plan
from layoutexplore.sensing.lidar import sensor
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.episode import run_seed


def test_configuration_from_toml(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text(
        """
        plans = ["test", "office:3"]
        starts = 4
        sensors = ["stage", "noisy"]
        [simulation]
        turn_cost = 0.5
        odometry_noise = { translation = 0.02 }
        [lidars.noisy]
        range_max = 8.0
        fov = 3.0
        beams = 90
        range_noise_std = 0.05
        """
    )
    config = BenchmarkConfig(**read_benchmark_config(path))
    assert config == BenchmarkConfig(**read_benchmark_config(str(path)))
    assert config.simulation == simulation_of_file(str(path), "stage")
    assert config.plans == ("test", "office:3") and config.starts == 4
    assert config.simulation.odometry_noise.translation == 0.02
    lidar = config.simulation_with("noisy").lidar
    assert (lidar.name, lidar.beams, lidar.range_noise_std) == ("noisy", 90, 0.05)
    assert config.simulation_with("stage").lidar.name == "stage"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("start = 3", "did you mean 'starts'"),
        ("plans = 3", "list of names"),
        ("starts = [", "not valid TOML"),
        ("starts = 0", "starts must be a whole number from 1 to 10000"),
        ("starts = 2147483648", "starts must be a whole number from 1 to 10000"),
        ("cell_seconds = inf", "cell_seconds must be a number from 0"),
        ("cell_mb = 'much'", "cell_mb must be a number from 0"),
        ("seed = 1.5", "seed must be a whole number"),
        ("agents = []", "at least one of agents"),
        ("agents = ['tour', 'tour']", "'tour' twice"),
        ("[simulation]\nresolutoin = 0.1", "did you mean 'resolution'"),
        ("noise = 'low'", r"'noise' stands under \[simulation\]"),
        ("sensor = 'stage'", "did you mean 'sensors'"),
        ("[simulation]\nsensor = 'stage'", "name the sensors in the list"),
        ("[simulation]\nresolution = -1.0", "resolution"),
        ("[lidars.mine]\nrange_max = 5.0", "missing"),
        ("simulation = 3", "simulation in .* must be a table"),
        ("lidars = { mine = 3 }", "expected a table"),
        ("[simulation]\nodometry_noise = 3", "expected a table"),
        ("[simulation]\nresolution = 'fine'", r"study\.toml \[simulation\]: resolution"),
        ("[simulation]\nresolution = true", "resolution must be a number from"),
        ("[simulation]\ngain_rays = 1.5", "gain_rays must be a whole number"),
        ("[simulation]\ngone_share = 7", "gone_share must be a number from 0 to 1"),
        ("poses = 3", "poses must be a Mapping"),
        ("[poses]\na = 3", "poses of 'a' must be a list of"),
        ("starts = 1\n[poses]\na = [[1, 2, 0], [3, 4, 0]]", r"no more than starts \(1\)"),
        ("[poses]\na = [[1, 2]]", "a pose of 'a' must be a list of 3 numbers"),
        ("baseline = 3", "baseline must be the name of an agent"),
    ],
)
def test_bad_configurations(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "study.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=said):
        BenchmarkConfig(**read_benchmark_config(path))


def test_a_configuration_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot read"):
        read_benchmark_config(tmp_path / "none.toml")


def test_the_hash_tells_settings_apart_but_not_what_is_run() -> None:
    config = BenchmarkConfig()
    assert config.config_hash == dataclasses.replace(config, agents=("tour",), starts=9).config_hash
    others = [
        {"seed": 1},
        {"simulation": SimulationConfig(turn_cost=0.1)},
        {"sensors": ("short",)},
        {"poses": {"a": [(1, 2, 0)]}},
    ]
    hashes = {dataclasses.replace(config, **change).config_hash for change in others}
    assert len(hashes | {config.config_hash}) == 5
    assert BenchmarkConfig(poses={"a": [(1.0, 2.0, 0.0)]}).config_hash in hashes


def test_numbers_that_are_equal_are_one_configuration(tmp_path: Path) -> None:
    """A file says `turn_cost = 0` or 0.0: runs in one folder had two hashes."""
    hashes, texts = set(), set()
    for zero, eight in (("0", "8"), ("0.0", "8.0")):
        (tmp_path / "study.toml").write_text(
            f"sensors = ['own']\n[simulation]\nturn_cost = {zero}\n"
            f"odometry_noise = {{ translation = {zero} }}\n"
            f"[lidars.own]\nrange_max = {eight}\nfov = 3.0\nbeams = 90\n"
        )
        config = BenchmarkConfig(**read_benchmark_config(tmp_path / "study.toml"))
        hashes.add(config.config_hash)
        texts.add(repr((config.simulation, config.lidars)))
    assert len(hashes) == len(texts) == 1


def test_cells_have_their_own_seeds() -> None:
    seeds = {run_seed(s, plan, start) for s in (0, 1) for plan in ("a", "b") for start in range(3)}
    assert len(seeds) == 12


@pytest.mark.parametrize("inside", ["", "settings."])
@pytest.mark.parametrize("key", ["simulation", "lidars"])
@pytest.mark.parametrize("value", ["5", "[1]", "'text'", "true"])
def test_settings_that_are_no_tables_are_named(tmp_path: Path, inside: str, key: str, value: str) -> None:
    path = tmp_path / "run.toml"
    path.write_text(f"{inside}{key} = {value}")
    with pytest.raises(ConfigError, match=rf"^{inside}{key} in .*run\.toml must be a table, got "):
        simulation_of_file(path, "stage")


def test_a_run_toml_that_is_cut_off_is_not_taken_for_one_of_defaults(tmp_path: Path) -> None:
    path = tmp_path / "run.toml"
    path.write_text("version = '0.2.0'\n[settings]\nseed = 0\n")
    with pytest.raises(ConfigError, match=r"run\.toml: \[settings\.simulation\] is missing"):
        simulation_of_file(path, "stage")


def test_many_plans_are_compared_soon() -> None:
    names = [f"office:{seed}" for seed in range(100_000)]
    assert len(BenchmarkConfig(plans=names).plans) == 100_000
    with pytest.raises(ConfigError, match="plans names 'office:7' twice"):
        BenchmarkConfig(plans=[*names, "office:7"])


def test_objects_instead_of_names_are_refused_with_what_to_do() -> None:
    for options, said in (
        ({"plans": [load_plan("office-01")]}, "save_plan"),
        ({"sensors": [sensor("stage")]}, "lidars="),
    ):
        with pytest.raises(ConfigError, match=said):
            BenchmarkConfig(**options)
