"""Names and options of agents."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from layoutexplore.agents import make_agent
from layoutexplore.agents.base import register
from layoutexplore.agents.greedy import Nearest, NearestOptions
from layoutexplore.errors import ConfigError, UnknownNameError
from layoutexplore.frontiers.decision import STOP, Decision
from layoutexplore.predictors import learned, make_predictor
from tests.agents.cases import decide

AHEAD = "plan-tour:predictor=oracle:horizon=inf"

KEPT = tuple(
    f"layout-tour:predictor={predictor}"
    for predictor in (
        *(
            "none",
            "oracle",
            "oracle:horizon=2",
            "oracle:flip=0.123456789",
            "oracle:horizon=x",
            "oracle:flop=1",
        ),
        *(
            "prior:true",
            "prior:rough",
            "prior:plan.png;scale=0.020",
            "prior:other-floor;among=explored;sure=0.50",
        ),
        *("reconstruct:rose2", "reconstruct:rose2;growth=0.3", "reconstruct:ias15;growth=0;sigma=0.2"),
        *(
            "reconstruct:mine.py:eroded;depth=0.40",
            "mine.py:Rooms:depth=0.40",
            "learned:rooms=rose2",
            "nonsense:a=1.0",
        ),
    )
)
"""Names under which results may be kept: they stay byte for byte what they are."""


@pytest.mark.parametrize(
    ("spec", "name"),
    [
        ("nearest:min_size=0.40", "nearest:min_size=0.4"),
        (" nearest : min_size = 1".replace(" :", ":"), "nearest"),
        ("nearest:distance=straight,min_size=0.5", "nearest:min_size=0.5,distance=straight"),
        ("cost-utility-0.9:alpha=0.9", "cost-utility-0.9"),
        ("clairvoyant:rounds=3", "clairvoyant:rounds=3"),
        ("layout-tour:predictor=oracle:flip=0.10", "layout-tour:predictor=oracle:flip=0.1"),
        ("mapex-gain:predictor=oracle:wrong=0;horizon=1.0", "mapex-gain:predictor=oracle:horizon=1"),
        ("plan-tour:predictor=oracle:within=2;flip=0;horizon=Infinity", f"{AHEAD};within=2"),
        (f"{AHEAD};within=2;wrong=0.1", f"{AHEAD};within=2;wrong=0.1"),
        ("layout-tour:predictor=layout:network=on", "layout-tour"),
        (
            "layout-tour:predictor=layout:network=off;model=a b/c",
            "layout-tour:predictor=layout:model=a b/c;network=off",
        ),
        (
            "layout-tour:predictor=reconstruct:rose2;growth=0.30",
            "layout-tour:predictor=reconstruct:rose2;growth=0.3",
        ),
        ("aamas-2021:predictor=reconstruct:ias15;growth=0.0", "aamas-2021"),
        *((name, name) for name in KEPT),
    ],
)
def test_specs_have_a_canonical_name(spec: str, name: str) -> None:
    assert make_agent(spec).name == name
    assert make_agent(make_agent(spec).name).name == name


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("nearst", "did you mean 'nearest'"),
        ("nearest:minsize=1", "did you mean 'min_size'"),
        ("nearest:", "nothing follows the colon"),
        ("nearest:min_size", "not of the form key=value"),
        ("nearest:min_size=", "not of the form key=value"),
        ("nearest:min_size=1,min_size=2", "given twice"),
        ("nearest:min_size=big", "must be a number, got 'big'"),
        ("nearest:min_size=nan", "must be a finite number, 0 or more"),
        ("nearest:min_size=-1", "must be a finite number, 0 or more"),
        ("nearest:distance=euclid", "unknown distance 'euclid'"),
        ("cost-utility:alpha=1.5", "from 0 to 1"),
        ("clairvoyant:rounds=2.5", "a whole number"),
        ("random:p=1", "has no parameters"),
        ("", "unknown agent"),
    ],
)
def test_bad_specs_say_what_is_wrong(spec: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        make_agent(spec)


def test_unknown_names_are_unknown_name_errors() -> None:
    with pytest.raises(UnknownNameError):
        make_agent("toor")


def test_a_name_is_given_once() -> None:
    register("nearest", "the same again", Nearest, NearestOptions())
    with pytest.raises(ConfigError, match="already"):
        register("nearest", "another", Nearest, NearestOptions(min_size=3.0))


@pytest.mark.parametrize("method", ["choose", "candidates", "scores"])
def test_what_is_no_decision_is_named_by_every_step_of_a_choice(method: str) -> None:
    for name in ("nearest", "layout-tour"):
        with pytest.raises(ConfigError, match="must be"):
            getattr(make_agent(name), method)(None)


@pytest.mark.parametrize("name", ["nearest", "random", "tour", "layout-tour", "wait"])
def test_a_choice_among_no_frontiers_is_refused(name: str) -> None:
    none = decide("R")
    assert make_agent(name).act(none) == STOP
    with pytest.raises(ConfigError, match="decision has no frontiers"):
        make_agent(name).choose(none)  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("agent", "change", "message"),
    [
        ("nearest", {"path_length": math.nan}, "frontier 0 whose lengths and area are not all finite"),
        ("mapex-gain", {"visible_area": math.inf}, "frontier 0 whose lengths and area are not all finite"),
        ("nearest", {"frontiers": (1, 2)}, "has frontiers that are no Frontier"),
        ("layout-tour", {"sensor": None}, "has a sensor that is no LidarConfig"),
        ("mapex-gain", {"grid": None}, "has a grid that is no OccupancyGrid"),
        ("plan-tour", {"field": None}, "has no field"),
    ],
)
def test_what_is_wrong_with_a_decision_is_told(agent: str, change: dict[str, Any], message: str) -> None:
    made = decide("R....", (0, 4, 1.0, 2.0))
    if change.keys() & {"path_length", "visible_area"}:
        change = {"frontiers": tuple(dataclasses.replace(f, **change) for f in made.frontiers)}
    with pytest.raises(ConfigError, match=message):
        make_agent(agent).act(dataclasses.replace(made, **change))


def test_predictors_tell_what_is_wrong_with_a_decision(monkeypatch: pytest.MonkeyPatch) -> None:
    made = decide("R....", (0, 4, 1.0, 2.0))
    beyond = dataclasses.replace(made.frontiers[0], cells=np.array([[0, 7]], np.int32))
    away = dataclasses.replace(made, frontiers=(beyond,))
    with pytest.raises(ConfigError, match="frontier 0 without cells, or with some outside of the grid"):
        make_predictor("learned").predict(away)  # type: ignore[union-attr]

    def fail(*_: object) -> None:
        raise IndexError("as kernels do that find nothing unknown")

    with monkeypatch.context() as patched:
        patched.setattr(learned, "score_frontiers", fail)
        with pytest.raises(ConfigError, match="frontier 0 that is beside no unknown cell"):
            make_predictor("learned").predict(made)  # type: ignore[union-attr]
    with pytest.raises(ConfigError, match="knows no plan yet"):
        make_predictor("oracle").predict(made)  # type: ignore[union-attr]


def test_an_error_of_an_own_agent_stays_as_it_is() -> None:
    class Own(Nearest):
        def choose(self, decision: Decision) -> int:
            return self.furthest([])

        def furthest(self, found: list[int]) -> int:
            return max(found)

    agent = Own("own", NearestOptions())
    with pytest.raises(ValueError, match="empty"):
        agent.act(decide("R....", (0, 4, 1.0, 2.0)))
