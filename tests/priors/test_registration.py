"""Registration finds the place of a plan, and knows when it has not."""

from __future__ import annotations

import copy
import dataclasses
import math
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import shapely

from layoutexplore.maps.floorplan import FloorPlan, Room
from layoutexplore.maps.library import load_plan
from layoutexplore.priors.confidence import confidence
from layoutexplore.priors.plan import PriorHints, PriorPlan, prior_of_plan
from layoutexplore.priors.presets import StudyPrior, study_prior
from layoutexplore.priors.registration import (
    FIRST_TRANSFORMED,
    HERE_STD,
    MIRRORED_COST,
    SCALE_SLACK,
    Registration,
)
from layoutexplore.priors.search import CoarseSearch
from tests.priors.cases import door_middles, office, seen_part


def doors_off(registration: Registration, made: StudyPrior) -> float:
    """Median error in metres of where the best hypothesis puts the doors."""
    assert made.place is not None
    doors = door_middles(office())
    found = registration.hypotheses[0].placed.to_world(made.place(doors))
    return float(np.median(np.hypot(*(found - doors).T)))


def registered(prior: PriorPlan, *shares: float) -> Registration:
    registration = Registration(prior)
    for share in shares:
        registration.update(seen_part(office(), share))
    return registration


@pytest.mark.parametrize("seed", range(4))
def test_a_true_plan_is_found_at_any_scale_and_rotation(seed: int) -> None:
    made = study_prior("true", office(), seed)
    registration = registered(made.prior, 0.5)
    assert doors_off(registration, made) < 0.3
    assert registration.hypotheses[0].fit.walls > 0.95
    assert confidence(registration) > 0.7


def test_a_mirrored_plan_is_found_as_one() -> None:
    made = study_prior("mirrored", office(), 1)
    registration = registered(made.prior, 0.6)
    assert registration.hypotheses[0].slice.mirrored and doors_off(registration, made) < 0.3


def test_a_rough_picture_is_found() -> None:
    made = study_prior("rough", office(), 2)
    registration = registered(made.prior, 0.4, 0.6, 0.7)
    assert doors_off(registration, made) < 1.0


@pytest.mark.parametrize("kind", ["wrong", "empty"])
def test_other_plans_are_not_believed(kind: str) -> None:
    made = study_prior(kind, office(), 0)
    assert made.place is None
    assert confidence(registered(made.prior, 0.4, 0.7)) < 0.5


def test_confidence_grows_with_what_is_seen() -> None:
    made = study_prior("true", office(), 0)
    little, much = (confidence(registered(made.prior, share)) for share in (0.12, 0.7))
    assert little < much


def test_several_hypotheses_are_kept_while_a_place_is_ambiguous() -> None:
    made = study_prior("true", office(), 0)
    registration = registered(made.prior, 0.12)
    assert len(registration.hypotheses) > 1
    totals = [h.total for h in registration.hypotheses]
    assert totals == sorted(totals, reverse=True)


def test_the_best_rival_the_other_way_round_is_kept() -> None:
    """However little it explains: how sure the best hypothesis is depends on it."""
    registration = registered(study_prior("true", office(), 0).prior, 0.4, 0.7)
    best, *others = registration.hypotheses
    rival = next(h for h in others if h.slice.mirrored != best.slice.mirrored)
    assert best.explained > rival.explained and not best.slice.mirrored
    assert rival.explained == rival.total + MIRRORED_COST and best.explained == best.total


def test_a_hint_of_rotation_leaves_one_orientation() -> None:
    prior = prior_of_plan(office(), PriorHints(rotation=0.0, mirror=False))
    registration = registered(prior, 0.5)
    assert {(h.slice.quarter, h.slice.mirrored) for h in registration.hypotheses} == {(0, False)}
    upside_down = prior_of_plan(office(), PriorHints(rotation=180.0, mirror=False))
    assert {h.slice.quarter for h in registered(upside_down, 0.5).hypotheses} == {2}


@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize("turns", range(4))
def test_a_hint_of_rotation_is_heard_of_mirrored_plans_too(turns: int, mirror: bool) -> None:
    drawn = prior_of_plan(office())
    # Rows count upwards: rot90 turns such an array clockwise, the map lies counter-clockwise of the plan.
    free, ids = (np.rot90(cells, turns) for cells in (drawn.free, drawn.room_ids))
    if mirror:
        free, ids = free[:, ::-1], ids[:, ::-1]
    hints = PriorHints(rotation=90.0 * turns, mirror=mirror)
    plan = PriorPlan(name="turned", free=free, room_ids=ids, resolution=0.1, scale_spread=0.04, hints=hints)
    assert registered(plan, 0.6).hypotheses[0].fit.walls > 0.95


def test_a_start_that_is_told_says_which_end_of_a_plan_it_is() -> None:
    """A building that is the same turned round: its left end is seen, and drawn at either end."""
    x = np.arange(6) * 5.0
    rooms = [shapely.box(0.0, 5.0, 29.8, 7.0)]
    rooms += [shapely.box(a, low, a + 4.8, low + 4.8) for low in (0.0, 7.2) for a in x]
    plan = FloorPlan(name="even", rooms=tuple(Room(id=k, polygon=room) for k, room in enumerate(rooms, 1)))
    for here, quarter in (((2.0, 6.0), 0), ((27.8, 6.0), 2)):
        registration = Registration(prior_of_plan(plan, PriorHints(scale=1.0, here=here)))
        registration.start = 2.0, 6.0
        registration.update(seen_part(plan, 0.45))
        best = registration.hypotheses[0]
        assert best.slice.quarter == quarter
        off = math.log(best.world_scale) / (SCALE_SLACK * registration.prior.scale_spread)
        told = best.placed.to_world(np.array([here]))[0] - registration.start
        known = -0.5 * off**2 - 0.5 * float(told @ told) / HERE_STD**2
        assert best.total == pytest.approx(best.fit.score - best.bending + known, abs=0.2)


def test_a_total_is_the_fit_with_what_is_known_before() -> None:
    prior = study_prior("mirrored", office(), 1).prior
    for h in registered(prior, 0.6).hypotheses:
        off = math.log(h.world_scale) / (SCALE_SLACK * prior.scale_spread)
        known = -0.5 * off**2 - MIRRORED_COST * h.slice.mirrored
        assert h.total == pytest.approx(h.fit.score - h.bending + known)


def test_nothing_seen_is_no_hypothesis() -> None:
    registration = registered(prior_of_plan(office()), 0.0)
    assert registration.hypotheses == [] and confidence(registration) == 0.0


def test_the_same_map_gives_the_same_hypotheses() -> None:
    made = study_prior("rough", office(), 5)
    first, second = (registered(made.prior, 0.3, 0.5) for _ in range(2))
    assert [h.total for h in first.hypotheses] == [h.total for h in second.hypotheses]


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda made: pickle.loads(pickle.dumps(made))])
def test_a_copy_goes_on_with_a_search_as_the_first_one_does(copied: Callable[[Any], Any]) -> None:
    first = Registration(study_prior("true", office(), 0).prior)
    for share in (0.3, 0.5, 0.5, 0.5):  # a search begins anew at the second, and goes on at the next ones
        later = copied(first)
        for registration in (first, later):
            registration.update(seen_part(office(), share))
        assert [h.total for h in later.hypotheses] == [h.total for h in first.hypotheses]


def test_a_plan_of_kilometres_is_searched_bit_by_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    searched: list[int] = []
    run = CoarseSearch.run
    monkeypatch.setattr(
        CoarseSearch, "run", lambda self, part: searched.append(self.cost(part)) or run(self, part)
    )
    far = Room(id=99, polygon=shapely.box(1200.0, 1196.0, 1204.0, 1200.0))
    prior = prior_of_plan(dataclasses.replace(office(), rooms=(*office().rooms, far)))
    registration = registered(prior, 0.5)
    assert max(searched) < sum(searched) < FIRST_TRANSFORMED + max(searched)
    assert registration.hypotheses == [] and confidence(registration) == 0.0
    done = len(searched)
    registration.update(seen_part(office(), 0.5))
    assert len(searched) == done + 1


def test_a_plan_is_registered_with_a_shipped_floor_that_it_is_not_of() -> None:
    prior = prior_of_plan(load_plan("school-03"))
    assert confidence(registered(prior, 0.7)) < 0.5
