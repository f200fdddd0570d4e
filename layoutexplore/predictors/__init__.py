"""Predictors: what a decision is told about rooms. Pluggable by name.

`none` tells nothing, `oracle` tells the truth (the ceiling of prediction), and `oracle:flip=0.1` tells it
with a share of the rooms judged wrongly, for the question how good a prediction has to be. `layout` is the
one to use, `layout:model=FOLDER` the same with models of one's own, `layout:network=off` the same by trees
alone, in less time; `reconstruct:METHOD` takes the rooms of any layout method (`reconstruct:rose2`, with
options `reconstruct:ias15;sigma=0.2`); `rectangle`, `hull`, `parallel-wall` and `face-subset` are what the
literature offers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from layoutexplore.frontiers.decision import Predictor
from layoutexplore.options import Options, option, parse_spec
from layoutexplore.predictors.learned import LearnedPredictor
from layoutexplore.predictors.oracle import FALSE_CLOSED_AREA, OraclePredictor
from layoutexplore.predictors.protocol import RoomLabels, RoomPredictor, with_classes
from layoutexplore.predictors.reconstructed import predictor_of_method
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
    "RoomLabels",
    "RoomPredictor",
    "make_predictor",
    "make_room_predictor",
    "predictor_names",
    "with_classes",
]


@dataclass(frozen=True, kw_only=True)
class OracleOptions(Options):
    """Parameters of `oracle`."""

    flip: float = option(0.0, "probability that a room is judged wrongly", low=0.0, high=1.0)


@dataclass(frozen=True, kw_only=True)
class LearnedOptions(Options):
    """Parameters of `layout`."""

    model: str = option("", "folder of models of one's own")
    network: str = option("on", "whether the networks have a say", choices=("on", "off"))


@dataclass(frozen=True, kw_only=True)
class ReconstructOptions(Options):
    """Parameters of `reconstruct`."""

    method: str = option("rose2", "a layout method, its options behind semicolons", whole=True)


_BUILDERS: dict[str, tuple[Options, Callable[[Any], RoomPredictor]]] = {
    "none": (Options(), lambda _: ShapePredictor("none", None)),
    "rectangle": (Options(), lambda _: ShapePredictor("rectangle", rectangle_outline)),
    "hull": (Options(), lambda _: ShapePredictor("hull", hull_outline)),
    "parallel-wall": (Options(), lambda _: ShapePredictor("parallel-wall", parallel_outline)),
    "face-subset": (Options(), lambda _: FaceSubsetPredictor()),
    "oracle": (OracleOptions(), lambda options: OraclePredictor(flip=options.flip)),
    "reconstruct": (ReconstructOptions(), lambda options: predictor_of_method(options.method)),
    "layout": (
        LearnedOptions(),
        lambda options: LearnedPredictor(
            Path(options.model) if options.model else None, network=options.network == "on"
        ),
    ),
}


def predictor_names() -> list[str]:
    """The names that `make_predictor` knows."""
    return list(_BUILDERS)


def make_predictor(spec: str) -> Predictor | None:
    """A predictor from `NAME` or `NAME:key=value,...`; None for "none".

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
    name, options = parse_spec("predictor", spec, {name: known for name, (known, _) in _BUILDERS.items()})
    return _BUILDERS[name][1](options)
