"""One checker of options: which numbers pass, what a message says, tables and texts."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from layoutexplore.agents import make_agent
from layoutexplore.agents.greedy import NearestOptions
from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.envs.curriculum import PlanSampler
from layoutexplore.envs.motion import MotionConfig
from layoutexplore.envs.observation import ObservationConfig
from layoutexplore.errors import ConfigError, LayoutExploreError, UnknownNameError
from layoutexplore.frontiers.tour_features import TourConfig
from layoutexplore.layout.pipeline import layout_method
from layoutexplore.maps.generator import PlanConfig
from layoutexplore.options import (
    Options,
    Rule,
    check,
    check_fields,
    format_spec,
    from_table,
    option,
    parse_options,
    rule_like,
)
from layoutexplore.simulation.config import SimulationConfig


@pytest.mark.parametrize(
    ("kind", "name", "number"),
    [
        (SimulationConfig, "gain_rays", 60),
        (SimulationConfig, "resolution", 0.25),
        (ObservationConfig, "max_frontiers", 8),
        (ObservationConfig, "local_span", 8.0),
        (MotionConfig, "scan_beams", 30),
        (PlanSampler, "seeds", 3),
        (PlanSampler, "growth", 0.5),
        (BenchmarkConfig, "starts", 3),
        (PlanConfig, "rooms", 20),
        (PlanConfig, "area", 500.0),
        (TourConfig, "patience", 0.5),
        (NearestOptions, "min_size", 0.5),
    ],
)
def test_every_configuration_takes_numbers_of_numpy_and_no_flags(kind: Any, name: str, number: float) -> None:
    for value in (number, np.float32(number) if isinstance(number, float) else np.int64(number)):
        kept = getattr(kind(**{name: value}), name)
        assert kept == number and type(kept) is type(number)
    for wrong in (True, np.True_, "1", None if kind is not PlanConfig else [1], math.nan):
        with pytest.raises(ConfigError, match=f"{name} must be"):
            kind(**{name: wrong})


@pytest.mark.parametrize(
    ("rule", "said"),
    [
        (Rule(), "a finite number"),
        (Rule(low=0), "a finite number, 0 or more"),
        (Rule(above=0, high=1), "a finite number above 0 and at most 1"),
        (Rule(low=0, below=1), "a finite number, 0 or more and below 1"),
        (Rule(low=0, high=1, optional=True), "a number from 0 to 1"),
        (Rule(kind=int, low=1), "a whole number, 1 or more"),
        (Rule(kind=int, low=1, high=9), "a whole number from 1 to 9"),
        (Rule(kind=bool), "true or false"),
        (Rule(kind=str, count=-1), "a list of names"),
        (Rule(count=2, low=0.7, high=1.4), "a list of 2 numbers from 0.7 to 1.4"),
    ],
)
def test_rules_say_what_they_allow(rule: Rule, said: str) -> None:
    with pytest.raises(ConfigError, match=f"x must be {said}, got {{}}"):
        rule.convert("x", {})


def test_a_rule_after_an_example() -> None:
    assert rule_like(2.0).convert("x", 3) == 3
    assert rule_like(None).convert("x", None) is None
    assert rule_like((1.0, 2.0)).convert("x", [np.int64(3), 4.5]) == (3, 4.5)
    assert rule_like((1.0, 2.0)).convert("x", np.array([3.0, 4.5], np.float32)) == (3.0, 4.5)
    assert rule_like(["a"]).convert("x", ()) == ()
    for example, wrong in (
        (2, 2.0),
        (2.0, True),
        (False, 0),
        ("a", 1),
        ((1, 2), (1, 2, 3)),
        ((1, 2), np.array([1, 2, 3])),
        ((1, 2), np.array([[1, 2]])),
        (["a"], [1]),
        ({}, 3),
    ):
        with pytest.raises(ConfigError, match="x must be"):
            rule_like(example).convert("x", wrong)


@dataclass(frozen=True, kw_only=True)
class Box:
    """A table with a key that is needed."""

    size: tuple[float, float]
    label: str = ""

    def __post_init__(self) -> None:
        check(self, "box.", size=Rule(count=2, above=0.0))


def test_tables() -> None:
    assert from_table(Box, {"size": [1, 2]}, "boxes.toml") == Box(size=(1, 2))
    for table, error, said in (
        (3, ConfigError, "expected a table in boxes.toml, got 3"),
        ({}, ConfigError, "boxes.toml: missing size"),
        ({"sice": [1, 2]}, UnknownNameError, "unknown key in boxes.toml: 'sice': did you mean 'size'"),
        ({"size": [1, 0]}, ConfigError, "boxes.toml: box.size must be a list of 2 numbers above 0"),
    ):
        with pytest.raises(error, match=said):
            from_table(Box, table, "boxes.toml")


@dataclass(frozen=True, kw_only=True)
class BallOptions(Options):
    """Parameters of a ball."""

    radius: float = option(1.0, "metres", low=0.0)
    bounces: int = option(2, "how often")
    filled: bool = option(False, "whether")
    colour: str = option("red", "of it", choices=("red", "blue"), positional=True)


def test_texts_are_read_as_they_are_written() -> None:
    def parsed(text: str | None) -> BallOptions:
        spec = "ball" if text is None else f"ball:{text}"
        options: BallOptions = parse_options("toy", spec, "ball", text, BallOptions())
        return options

    options = parsed("blue,filled=true,radius=2")
    assert options == BallOptions(radius=2.0, filled=True, colour="blue")
    assert format_spec("ball", options, BallOptions()) == "ball:blue,radius=2,filled=true"
    assert parsed("blue,radius=2,filled=true") == options
    assert parsed(None) == BallOptions() and format_spec("ball", BallOptions(), BallOptions()) == "ball"
    for text, said in (
        ("filled=yes", "toy 'ball:filled=yes': filled must be true or false, got 'yes'"),
        ("green", "unknown colour 'green'"),
        ("bounces=1.5", "bounces must be a whole number"),
        ("radius=-1", "radius must be a finite number, 0 or more"),
        ("red,size=1", "unknown parameter of toy 'ball' 'size'"),
    ):
        with pytest.raises(ConfigError, match=said):
            parsed(text)


def test_a_parameter_that_is_meant_for_an_inner_name_is_told_how_to_be_written() -> None:
    with pytest.raises(ConfigError, match=r"'within'.*semicolons: 'predictor=oracle:flip=0\.1;within=2'"):
        make_agent("plan-tour:predictor=oracle:flip=0.1,within=2")
    with pytest.raises(ConfigError) as error:
        make_agent("plan-tour:within=2,predictor=layout")
    assert "semicolons" not in str(error.value)
    assert make_agent("plan-tour:predictor=oracle:flip=0.1;within=2")


def test_a_message_about_a_long_text_is_short() -> None:
    for text in ("nearest:min_size=" + "1" * 5000, "nearest:" + "x" * 5000, "nearest:" + "y" * 5000 + "=1"):
        with pytest.raises(LayoutExploreError) as error:
            make_agent(text)
        assert len(str(error.value)) < 1200


@pytest.mark.parametrize(
    "method", ["default", "rose", "rose2", "ias15", "voronoi", "distance", "morphological"]
)
def test_configurations_of_layout_methods_refuse_values_of_another_kind(method: str) -> None:
    config = layout_method(method).config()
    for field in dataclasses.fields(config):
        for value in ("x", b"x", [], {}, 1j, object(), math.nan, 10**400, np.ones((3, 3))):
            with pytest.raises(ConfigError):
                dataclasses.replace(config, **{field.name: value})


def test_a_field_may_have_a_rule_of_its_own() -> None:
    @dataclasses.dataclass(frozen=True)
    class Levels:
        low: float = 0.0
        high: float = dataclasses.field(default=2.0, metadata={"rule": Rule(finite=False)})

        def __post_init__(self) -> None:
            check_fields(self)

    assert Levels(high=math.inf).high == math.inf
    assert Levels(low=np.float64(1.0)).low == 1.0
    for wrong in ({"low": math.inf}, {"high": math.nan}, {"high": None}):
        with pytest.raises(ConfigError, match="number"):
            Levels(**wrong)  # type: ignore[arg-type]
