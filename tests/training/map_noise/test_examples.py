"""Simulated maps as examples, and the lidar that walks from room to room."""

from __future__ import annotations

import numpy as np
import pytest

from layoutexplore.grids.grid import FREE
from layoutexplore.maps import load_plan
from layoutexplore.training.map_noise import examples
from layoutexplore.training.map_noise.examples import (
    noisy_example,
    polygonal_examples,
    simulated_examples,
    weathered_pairs,
)
from layoutexplore.training.map_noise.simulate import MapNoiseConfig
from layoutexplore.training.merging_examples import SIMULATED
from layoutexplore.training.simulated_maps import see

ROUGH = MapNoiseConfig(resolution=(0.1, 0.1), beams=(120, 120), spacing=(2.5, 2.5), explored=(1.2, 1.2))


def test_an_explored_map_shows_more_than_the_room_of_the_start() -> None:
    raster = load_plan("apartment:1").rasterize(0.05)
    rooms = []
    for seed in range(8):
        cells = see(raster.occupied, raster.origin, np.random.default_rng(seed))
        assert cells is not None and not ((cells == FREE) & raster.occupied).all()
        counts = np.bincount(raster.room_ids[cells == FREE])[1:]
        rooms.append(int((counts * 0.05**2 > 2.0).sum()))
    assert max(rooms) >= 4


def test_a_noisy_map_becomes_regions_and_the_rooms_they_lie_in() -> None:
    plan = load_plan("apartment:1")
    example = noisy_example(plan, ROUGH, np.random.default_rng(0))
    assert example is not None
    assert (example.building, example.kind) == (SIMULATED, plan.name)
    assert len(example.graph.nodes) == len(example.rooms) > 3
    assert (example.rooms[:, 1:].sum(0) > 0).sum() >= 3


def test_examples_take_turns_of_noise_and_are_the_same_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(examples, "NOISES", (None, ROUGH))
    plans, told = ("apartment:2", "apartment:3"), []
    monkeypatch.setattr(examples, "generated_plan", lambda k, seed: load_plan(f"apartment:{2 + k % 2}"))
    first = simulated_examples(4, plans, progress=lambda *done: told.append(done))
    assert told == [("maps simulated", k, 4) for k in (1, 2, 3, 4)]
    again = simulated_examples(4, plans)
    assert 2 <= len(first) == len(again)
    assert all(np.array_equal(a.rooms, b.rooms) for a, b in zip(first, again, strict=True))


def test_some_noisy_maps_are_weathered_besides(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(examples, "NOISES", (None, ROUGH))
    monkeypatch.setattr(examples, "WEATHERED", 1.0)
    monkeypatch.setattr(examples, "generated_plan", lambda k, seed: load_plan(f"apartment:{2 + k % 2}"))
    plans = ("apartment:2", "apartment:3")
    plain, pairs = simulated_examples(4, plans), weathered_pairs(4, plans)
    assert all(np.array_equal(one.rooms, a.rooms) for one, (a, _) in zip(plain, pairs, strict=True))
    assert {a.noisy for a, _ in pairs} == {True, False}
    for a, b in pairs:
        assert (a is b) == (not a.noisy)
        assert (a.kind, a.noisy) == (b.kind, b.noisy)


def test_polygonal_buildings_are_drawn_or_have_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(examples, "noisy_example", lambda plan, noise, rng: None)
    found = polygonal_examples(3, seed=3)
    assert [example.kind for example in found] == ["polygonal-3001", "polygonal-3002"]
    again = polygonal_examples(3, seed=3)
    for one, other in zip(found, again, strict=True):
        assert one.building == SIMULATED and not one.noisy
        assert (one.rooms == other.rooms).all() and (one.rooms[:, 1:].sum(0) > 0).all()
