"""Plans without end and sensors that change: data in, the same episodes for the same seed out."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest

from layoutexplore.envs.curriculum import FIRST_SEED, PlanSampler, Randomisation
from layoutexplore.envs.observation import ObservationConfig
from layoutexplore.errors import ConfigError, UnknownNameError
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.library import load_plan
from layoutexplore.maps.shipped import SHIPPED
from layoutexplore.options import from_table
from layoutexplore.sensing.lidar import sensor
from layoutexplore.simulation.config import NOISE, SimulationConfig
from layoutexplore.simulation.robot import OdometryNoise
from tests.envs.cases import FRONTIER, rooms

BARE = ObservationConfig(local_map=False, global_map=False)
SMALL = {"families": {"office": 1.0, "apartment": 3.0}, "area": (150.0, 400.0), "shipped_share": 0.0}


def test_plans_depend_on_the_seed_alone() -> None:
    sampler, again = PlanSampler(**SMALL), PlanSampler(**SMALL)
    rng, other = np.random.default_rng(4), np.random.default_rng(4)
    plans = [sampler(rng) for _ in range(5)]
    assert [plan.content_hash for plan in plans] == [again(other).content_hash for _ in range(5)]
    assert len({plan.content_hash for plan in plans}) == 5
    assert all(100 <= plan.area <= 500 and plan.metadata["family"] in SMALL["families"] for plan in plans)
    assert all(int(plan.metadata["seed"]) >= FIRST_SEED for plan in plans)


def test_no_shipped_building_is_drawn_by_the_generator() -> None:
    assert all(plan.seed < FIRST_SEED for plan in SHIPPED)


def test_shipped_plans_come_in_between() -> None:
    sampler = PlanSampler(**SMALL | {"shipped_share": 1.0, "shipped": ("validation", "office-01")})
    names = {sampler(np.random.default_rng(seed)).name for seed in range(40)}
    assert names == {"office-03", "school-03", "school-04", "angled-02", "office-01"}


def test_few_seeds_are_few_plans() -> None:
    sampler, rng = (
        PlanSampler(**SMALL | {"seeds": 2, "families": {"apartment": 1.0}}),
        np.random.default_rng(0),
    )
    plans = [sampler(rng) for _ in range(12)]
    assert len({id(plan) for plan in plans}) == 2, "plans drawn before are kept"


def test_plans_grow_with_the_progress() -> None:
    sampler = PlanSampler(**SMALL | {"area": (150.0, 900.0), "first_area": 200.0, "growth": 0.5})
    early, late = ([sampler.draw(np.random.default_rng(s), p).area for s in range(6)] for p in (0.0, 0.5))
    assert max(early) < 260 and max(late) > 400
    assert late == [sampler(np.random.default_rng(s)).area for s in range(6)]


def test_an_environment_tells_its_progress() -> None:
    sampler = PlanSampler(**SMALL | {"area": (150.0, 900.0), "first_area": 200.0})
    env = gymnasium.make_vec(FRONTIER, num_envs=2, backend="serial", plan=sampler, observation=BARE)
    env.set_attr("progress", 0.0)
    env.reset(seed=3)
    assert all(simulation.plan.area < 260 for simulation in env.get_attr("simulation"))
    env.close()


def test_a_curriculum_need_not_be_callable() -> None:
    class Growing:
        def draw(self, rng: np.random.Generator, progress: float) -> FloorPlan:
            return load_plan("office-01" if progress > 0.5 else "apartment-01")

    env = gymnasium.make("LayoutExplore/Frontier-v0", plan=Growing()).unwrapped
    names = []
    for progress in (0.0, 1.0):
        env.progress = progress
        env.reset(seed=0)
        names.append(env.plan_name)
    assert names == ["apartment-01", "office-01"]


def test_sensors_change_from_episode_to_episode() -> None:
    changes = Randomisation(
        sensors=("indoor", "short"),
        range_noise=(0.0, 0.03),
        dropout=(0.0, 0.1),
        drift=(0.0, 0.01),
        robot_radius=(0.15, 0.2),
    )
    env: Any = gymnasium.make(FRONTIER, plan=rooms(), observation=BARE, randomisation=changes).unwrapped
    configs = []
    for seed in range(30):
        _, info = env.reset(seed=seed)
        configs.append(env.simulation.config)
        _, again = env.reset(seed=seed)
        assert env.simulation.config == configs[-1] and again["simulation_seed"] == info["simulation_seed"]
    assert {config.lidar.name for config in configs} == {"indoor", "short"}
    assert {config.lidar.range_noise_std for config in configs} == {0.0, 0.03}
    assert {config.lidar.dropout for config in configs} == {0.0, 0.1}
    assert {config.odometry_noise.translation for config in configs} == {0.0, 0.01}
    assert {config.robot_radius for config in configs} == {0.15, 0.2}


def test_what_is_drawn_stands_instead_of_the_environments_own_noise() -> None:
    level, rng = SimulationConfig(sensor="indoor", noise="middle"), np.random.default_rng(0)
    middle = NOISE["middle"]
    drifting = Randomisation(drift=(0.07,)).draw(rng, level)
    assert drifting.odometry == OdometryNoise(translation=0.07, rotation=0.1 * 0.07)
    assert drifting.lidar == level.lidar and level.lidar.range_noise_std == middle.range_std
    exact = Randomisation(range_noise=(0.0,), dropout=(0.0,), drift=(0.0,)).draw(rng, level)
    assert exact == SimulationConfig(sensor=sensor("indoor"))
    failing = Randomisation(sensors=("short",), dropout=(0.2,)).draw(rng, level)
    assert (failing.lidar.name, failing.lidar.dropout) == ("short", 0.2)
    assert failing.lidar.range_noise_std == middle.range_std and failing.odometry == middle.odometry
    own = SimulationConfig(sensor=replace(sensor("indoor"), range_noise_std=0.05))
    assert Randomisation(range_noise=(0.0,)).draw(rng, own).lidar == sensor("indoor")
    assert Randomisation(dropout=(0.02,)).draw(rng, own).lidar.range_noise_std == 0.05
    assert Randomisation().draw(rng, level).odometry == middle.odometry


def test_nothing_to_change_changes_nothing() -> None:
    config = SimulationConfig(sensor="mapex")
    assert Randomisation().draw(np.random.default_rng(0), config).lidar == config.lidar


def test_tables_of_a_file_are_read() -> None:
    tables = tomllib.loads(
        """
        [plans]
        families = { office = 2, school = 1 }
        area = [300, 900.0]
        clutter = [0.0, 0.2]
        seeds = 500
        shipped = ["train"]
        first_area = 400
        [randomisation]
        sensors = ["stage", "indoor"]
        range_noise = [0.0, 0.02]
        """
    )
    assert from_table(PlanSampler, tables["plans"], "plans") == PlanSampler(
        families={"office": 2, "school": 1}, area=(300, 900.0), clutter=(0.0, 0.2), seeds=500, first_area=400
    )
    assert from_table(Randomisation, tables["randomisation"], "randomisation") == Randomisation(
        sensors=("stage", "indoor"), range_noise=(0.0, 0.02)
    )


@pytest.mark.parametrize(
    ("kind", "table", "error", "text"),
    [
        (PlanSampler, {"famlies": {}}, UnknownNameError, "families"),
        (PlanSampler, {"families": {"offices": 1}}, UnknownNameError, "office"),
        (PlanSampler, {"families": {"office": -1}}, ConfigError, "weight of office"),
        (PlanSampler, {"families": {"office": 0}}, ConfigError, "above 0"),
        (PlanSampler, {"area": [900, 300]}, ConfigError, "least value"),
        (PlanSampler, {"area": 300}, ConfigError, "list of 2"),
        (PlanSampler, {"clutter": [0, 3]}, ConfigError, "clutter"),
        (PlanSampler, {"shipped": ["trian"]}, UnknownNameError, "train"),
        (PlanSampler, {"shipped": []}, ConfigError, "shipped"),
        (PlanSampler, {"shipped_share": 2}, ConfigError, "shipped_share"),
        (Randomisation, {"sensors": ["stagee"]}, UnknownNameError, "stage"),
        (Randomisation, {"range_noise": []}, ConfigError, "at least one"),
        (Randomisation, {"dropout": [1.5]}, ConfigError, "dropout"),
        (Randomisation, {"robot_radius": [0.0]}, ConfigError, "robot_radius"),
        (PlanSampler, {"seeds": 1.5}, ConfigError, "seeds"),
    ],
)
def test_tables_are_checked(kind: Any, table: dict[str, Any], error: type[Exception], text: str) -> None:
    with pytest.raises(error, match=text):
        from_table(kind, table, "plans")
