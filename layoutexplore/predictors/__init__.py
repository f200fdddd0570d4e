"""Predictors: what a decision is told about rooms. Pluggable by name.

`none` tells nothing, `oracle` tells the truth (the ceiling of prediction), and `oracle:flip=0.1` tells it with a share of
the rooms judged wrongly, for the question how good a prediction has to be.
"""

from __future__ import annotations

from layoutexplore.decision import Predictor
from layoutexplore.errors import ConfigError, unknown_name
from layoutexplore.predictors.oracle import FALSE_CLOSED_AREA, OraclePredictor
from layoutexplore.predictors.protocol import RoomMap, RoomPredictor, with_classes

__all__ = [
    "FALSE_CLOSED_AREA",
    "OraclePredictor",
    "RoomMap",
    "RoomPredictor",
    "make_predictor",
    "predictor_names",
    "with_classes",
]


def predictor_names() -> list[str]:
    """The names that `make_predictor` knows."""
    return ["none", "oracle"]


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
    name, _, text = spec.partition(":")
    if name not in predictor_names():
        raise unknown_name("predictor", name, predictor_names())
    if name == "none" and not text:
        return None
    if not text:
        return OraclePredictor()
    key, _, value = text.partition("=")
    if name != "oracle" or key != "flip":
        raise ConfigError(f"predictor {spec!r}: only oracle:flip=SHARE takes a parameter")
    try:
        return OraclePredictor(flip=float(value))
    except ValueError as error:
        raise ConfigError(f"predictor {spec!r}: flip is a probability 0..1, got {value!r}") from error
