"""Predictors: what a decision is told about rooms. Pluggable by name.

`none` tells nothing, `oracle` tells the truth (the ceiling of prediction), and `oracle:flip=0.1` tells it
with a share of the rooms judged wrongly, for the question how good a prediction has to be. `layout` is the
one to use, `layout:model=FOLDER` the same with models of one's own, `layout:network=off` the same by trees
alone, in less time; `rectangle`, `hull`, `parallel-wall` and `face-subset` are what the literature offers.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from layoutexplore.errors import ConfigError, unknown_name
from layoutexplore.frontiers.decision import Predictor
from layoutexplore.predictors.learned import LayoutPredictor
from layoutexplore.predictors.oracle import FALSE_CLOSED_AREA, OraclePredictor
from layoutexplore.predictors.protocol import RoomMap, RoomPredictor, with_classes
from layoutexplore.predictors.shape_baselines import (
    FaceSubsetPredictor,
    ShapePredictor,
    hull_outline,
    parallel_outline,
    rectangle_outline,
)

__all__ = [
    "FALSE_CLOSED_AREA",
    "OraclePredictor",
    "RoomMap",
    "RoomPredictor",
    "make_predictor",
    "make_room_predictor",
    "predictor_names",
    "with_classes",
]

_BUILDERS: dict[str, Callable[[], RoomPredictor]] = {
    "none": lambda: ShapePredictor("none", None),
    "rectangle": lambda: ShapePredictor("rectangle", rectangle_outline),
    "hull": lambda: ShapePredictor("hull", hull_outline),
    "parallel-wall": lambda: ShapePredictor("parallel-wall", parallel_outline),
    "face-subset": FaceSubsetPredictor,
    "oracle": OraclePredictor,
    "layout": LayoutPredictor,
}


def predictor_names() -> list[str]:
    """The names that `make_predictor` knows."""
    return list(_BUILDERS)


def make_predictor(spec: str) -> Predictor | None:
    """A predictor from `NAME` or `NAME:key=value`; None for "none".

    Raises:
        UnknownNameError: There is no predictor of that name.
        ConfigError: It has no such parameter, or the value makes no sense.

    Example:
        >>> make_predictor("oracle:flip=0.25").name
        'oracle:flip=0.25'
        >>> make_predictor("none")
    """
    return None if spec == "none" else make_room_predictor(spec)


def make_room_predictor(spec: str) -> RoomPredictor:
    """Like `make_predictor`, but "none" is a predictor too: rooms are what is seen of them.

    Raises:
        UnknownNameError: There is no predictor of that name.
        ConfigError: It has no such parameter, or the value makes no sense.
    """
    name, _, text = spec.partition(":")
    if name not in _BUILDERS:
        raise unknown_name("predictor", name, predictor_names())
    if not text:
        return _BUILDERS[name]()
    key, _, value = text.partition("=")
    if (name, key) == ("layout", "model") and value:
        return LayoutPredictor(Path(value))
    if (name, key, value) == ("layout", "network", "off"):
        return LayoutPredictor(network=False)
    if (name, key) != ("oracle", "flip"):
        known = "oracle:flip=SHARE, layout:model=FOLDER and layout:network=off"
        raise ConfigError(f"predictor {spec!r}: the parameters that there are: {known}")
    try:
        return OraclePredictor(flip=float(value))
    except ValueError as error:
        raise ConfigError(f"predictor {spec!r}: flip is a probability 0..1, got {value!r}") from error
