"""What only critics see, and that policies outside of an environment see everything else."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from numpy.typing import NDArray

from layoutexplore.envs.egocentric_maps import CHANNELS, LAYOUT_CHANNELS
from layoutexplore.envs.observation import (
    FRONTIER_FEATURES,
    PRIVILEGED_FEATURES,
    Observation,
    ObservationConfig,
    Observer,
)
from layoutexplore.envs.room_progress import RoomDistances
from layoutexplore.errors import ConfigError, UnknownNameError
from layoutexplore.frontiers.decision import STOP, Decision
from layoutexplore.planning.shortest_paths import distance_matrix, geodesic_distances
from layoutexplore.predictors import make_predictor
from layoutexplore.simulation.robot import OdometryNoise
from layoutexplore.simulation.simulation import Simulation, SimulationConfig
from tests.envs.cases import FRONTIER, rooms
from tests.plans import offices

SMALL = {"local_size": 16, "global_size": 16}


def make(**options: Any) -> Any:
    return gymnasium.make(FRONTIER, **{"plan": rooms(), "sensor": "short"} | options).unwrapped


def choose(observation: Observation) -> int:
    """Any function of what is observed, so that other observations make other choices."""
    total = int(
        sum(
            int(np.asarray(value, np.float64).sum() * 1000)
            for key, value in observation.items()
            if key != "privileged"
        )
    )
    valid = np.flatnonzero(observation["action_mask"][:-1])
    return int(valid[total % len(valid)]) if len(valid) else len(observation["action_mask"]) - 1


class ObservingAgent:
    """Acts from decisions alone, by an observer of its own."""

    name = "observing"

    def __init__(self, config: ObservationConfig) -> None:
        self.observer, self.slots = Observer(config), config.max_frontiers
        self.seen: list[Observation] = []

    def reset(self, seed: int) -> None:
        self.seen = []

    def act(self, decision: Decision) -> int:
        self.seen.append(self.observer.observe(decision))
        action = choose(self.seen[-1])
        return STOP if action == self.slots else action


@pytest.mark.parametrize("predictor", ["none", "oracle", "layout"])
@pytest.mark.parametrize(
    "noise", [OdometryNoise(), OdometryNoise(translation=0.02, rotation=0.01)], ids=["exact", "drifting"]
)
def test_an_agent_sees_what_the_environment_shows(predictor: str, noise: OdometryNoise) -> None:
    observation_config = ObservationConfig(detour=True, privileged=True, **SMALL)
    config = SimulationConfig(sensor="short", odometry_noise=noise, max_distance=60.0)
    env = make(predictor=predictor, observation=observation_config, simulation=config)
    agent = ObservingAgent(observation_config)
    for seed in (1, 2):
        observation, info = env.reset(seed=seed)
        shown, over = [observation], False
        while not over:
            observation, _, terminated, truncated, _ = env.step(choose(shown[-1]))
            shown.append(observation)
            over = terminated or truncated
        simulation = Simulation(env.simulation.plan, config, make_predictor(predictor))
        decision = simulation.reset(info["simulation_seed"])
        agent.reset(0)
        while not simulation.done:
            decision = simulation.step(agent.act(decision))
        np.testing.assert_array_equal(simulation.track, env.simulation.track)
        assert len(agent.seen) == len(shown) - 1
        for mine, theirs in zip(agent.seen, shown, strict=False):
            assert mine.keys() == theirs.keys()
            for key in mine.keys() - {"privileged"}:
                np.testing.assert_array_equal(mine[key], theirs[key])
            assert not mine["privileged"].any() and theirs["privileged"].any()


def test_privileged_entries_mean_what_they_say() -> None:
    env = make(observation=ObservationConfig(privileged=True, length_scale=2.0, area_scale=5.0, **SMALL))
    observation, _ = env.reset(seed=0)
    over = False
    while not over:
        named = dict(zip(PRIVILEGED_FEATURES, observation["privileged"].tolist(), strict=True))
        simulation = env.simulation
        area, coverage = simulation.target_area, simulation.coverage
        assert env.observation_space.contains(observation)
        assert named["coverage"] == pytest.approx(coverage)
        assert named["remaining_area"] * 5.0 == pytest.approx(area * (1 - coverage), abs=1e-3)
        assert named["building_area"] * 5.0 == pytest.approx(area, rel=1e-5)
        assert named["budget_used"] == pytest.approx(simulation.distance / simulation.max_distance)
        assert named["length_to_95"] <= named["length_to_99"] <= named["remaining_tour"] + 1e-5
        assert (named["length_to_95"] == 0) == (coverage >= 0.95 or named["rooms_left"] == 0)
        observation, _, terminated, truncated, _ = env.step(0)
        over = terminated or truncated
    assert observation["privileged"][list(PRIVILEGED_FEATURES).index("rooms_left")] == 0.0
    assert "privileged" not in make().reset(seed=0)[0]


def test_an_episode_in_a_region_tells_nothing_of_another_in_the_whole_building() -> None:
    plan = offices()
    x0, y0, x1, y1 = plan.bounds
    middle = (x0 + x1) / 2
    half = SimulationConfig(region=((x0, y0), (middle, y0), (middle, y1), (x0, y1)))
    sizes = []
    for simulation in (half, SimulationConfig(), half):
        env = make(plan=plan, simulation=simulation, observation=ObservationConfig(privileged=True, **SMALL))
        env.reset(seed=2)
        distances, ids = env._privileged._distances, env.simulation.raster.room_ids
        assert distances.rooms.tolist() == [k for k in np.unique(ids[env.simulation.truth.target]) if k]
        sizes.append(len(distances.rooms))
    assert sizes[0] < sizes[1]


def test_the_tour_of_the_critic_visits_what_is_left() -> None:
    env = make(observation=ObservationConfig(privileged=True, **SMALL))
    env.reset(seed=3)
    for _ in range(3):
        env.step(1)
    view, ledger = env._privileged, env._ledger
    distances = view._distances
    assert sorted(distances.rooms[view._order].tolist()) == np.flatnonzero(ledger.open).tolist()
    simulation, shown = env.simulation, dict(zip(PRIVILEGED_FEATURES, view.vector().tolist(), strict=True))
    here = simulation.raster.world_to_cell(simulation.pose.x, simulation.pose.y)
    legs = [distances.to_rooms(here)[view._order[0]], *distances.between[view._order[:-1], view._order[1:]]]
    lengths, left = np.cumsum(legs), np.cumsum(ledger.left[distances.rooms[view._order]])
    scale, unseen = env.observation_config.length_scale, 1.0 - simulation.coverage
    assert shown["remaining_tour"] == pytest.approx(lengths[-1] / scale)
    for name, mark in (("length_to_95", 0.05), ("length_to_99", 0.01)):
        seen = np.concatenate([[0.0], left / left[-1] * unseen])
        expected = np.interp(unseen - mark, seen, np.concatenate([[0.0], lengths])) if unseen > mark else 0.0
        assert shown[name] == pytest.approx(expected / scale, rel=1e-5)


def test_distances_between_rooms_are_geodesic() -> None:
    simulation = Simulation(rooms(), SimulationConfig(sensor="short"))
    simulation.reset(0)
    truth = simulation.truth
    distances = RoomDistances(truth)
    assert len(distances.rooms) == len(
        np.unique(truth.raster.room_ids[truth.target & (truth.raster.room_ids > 0)])
    )
    here = truth.raster.world_to_cell(simulation.pose.x, simulation.pose.y)
    field = geodesic_distances(truth.reachable, here, 0.1)
    middles = [np.argwhere((truth.raster.room_ids == room) & truth.reachable) for room in distances.rooms]
    nearest = [min(cells, key=lambda c: np.abs(c - cells.mean(axis=0)).sum()) for cells in middles]
    np.testing.assert_allclose(distances.to_rooms(here), [field[tuple(cell)] for cell in nearest], atol=1.0)
    exact = distance_matrix(truth.reachable, np.array(nearest, np.int32), 0.1)
    np.testing.assert_allclose(distances.between, exact, atol=1.0)


def named_columns(observation: Observation) -> dict[str, np.ndarray]:
    table = np.asarray(observation["frontiers"]).reshape(-1, len(FRONTIER_FEATURES))
    return dict(zip(FRONTIER_FEATURES, table[table[:, 0] == 1].T, strict=True))


def test_a_predictor_by_name_fills_what_a_layout_tells_and_none_leaves_it_empty() -> None:
    config = ObservationConfig(detour=True)
    told = {
        name: make(predictor=name, plan="office-01", observation=config)
        for name in ("layout", "oracle", "none")
    }
    assert len({str(env.observation_space) for env in told.values()}) == 1
    shown = {}
    for name, env in told.items():
        env.reset(seed=1)
        for _ in range(8):
            shown[name] = env.step(0)[0]
        assert env.observation_space.contains(shown[name])
    for name in ("layout", "oracle"):
        columns = named_columns(shown[name])
        assert set(columns["class"]) == {-1.0, 1.0} and columns["expected_area"].any()
        assert (columns["confidence"] >= 0.5).all() and shown[name]["robot"][-1] > 0
    columns = named_columns(shown["none"])
    assert not any(columns[key].any() for key in ("class", "expected_area", "confidence"))
    assert columns["tour_rank"].max() == 1.0 and shown["none"]["robot"][-1] == 0
    known = len(CHANNELS)
    for key in ("local_map", "global_map"):
        assert not shown["none"][key][known:].any()
    for k in range(len(LAYOUT_CHANNELS)):
        assert shown["layout"]["global_map"][known + k].any(), LAYOUT_CHANNELS[k]


@pytest.mark.parametrize("method", ["rose2", "distance"])
def test_a_layout_method_fills_what_a_layout_tells(method: str) -> None:
    env = make(
        predictor=f"reconstruct:{method}", plan="office-01", observation=ObservationConfig(detour=True)
    )
    observation, _ = env.reset(seed=1)
    classes = {0.0}
    for _ in range(30):
        observation, _, terminated, truncated, _ = env.step(0)
        if terminated or truncated:
            break
        columns = named_columns(observation)
        classes |= set(columns["class"].tolist())
        assert (columns["confidence"] == 1.0).all() and env.observation_space.contains(observation)
    assert {-1.0, 1.0} <= classes and observation["global_map"][len(CHANNELS)].any()


def test_predictors_by_name_and_as_objects_are_the_same() -> None:
    named, given = make(predictor="oracle:flip=0.25"), make(predictor=make_predictor("oracle:flip=0.25"))
    for env in (named, given):
        env.reset(seed=2)
    np.testing.assert_array_equal(named.step(0)[0]["frontiers"], given.step(0)[0]["frontiers"])
    with pytest.raises(UnknownNameError, match="layout"):
        make(predictor="layouts")


class WholeHall:
    """A user's own predictor: all that is known is one room."""

    def rooms(self, decision: Decision) -> NDArray[np.int32]:
        """One room."""
        return (decision.grid.cells == 0).astype(np.int32)


@pytest.mark.parametrize("given", [WholeHall, WholeHall()])
def test_what_has_rooms_is_a_predictor(given: object) -> None:
    env = make(predictor=given)
    observation, _ = env.reset(seed=2)
    assert (named_columns(observation)["class"] != 0.0).any()
    with pytest.raises(ConfigError, match="neither rooms"):
        make(predictor=object())
    with pytest.raises(ConfigError, match="make_predictor"):
        Simulation("apartment-01", predictor=given)  # type: ignore[arg-type]
