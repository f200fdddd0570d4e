"""Predictors: what a decision is told about rooms. Pluggable by name.

`none` tells nothing, `oracle` tells the truth (the ceiling of prediction), and `oracle:flip=0.1` tells it
with a share of the rooms judged wrongly, for the question how good a prediction has to be;
`oracle:horizon=2` also foresees the true plan up to two doors beyond what is seen, and
`oracle:horizon=inf,within=2,wrong=0.1` up to 2 m beyond known floor, a tenth of it wrongly. `layout` is the
one to use, `layout:model=FOLDER` the same with models of one's own, `layout:network=off` the same by trees
alone, in less time, and `layout:ahead=2` completes the map by 2 m once no open frontier is left, for
`plan-tour`; `learned:rooms=METHOD` lets these models complete the rooms of any layout method, where
`layout` has those of `doorways`. `reconstruct:METHOD` completes a method's rooms by lines instead
(`reconstruct:rose2`, with options `reconstruct:ias15;sigma=0.2`); `rectangle`, `hull`, `parallel-wall` and
`face-subset` are what the literature offers. `prior:FILE` registers a plan known beforehand with the map and
foresees unseen rooms by it; `prior:rough` and the like make such a plan from that of the run, for studies.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from layoutexplore.errors import ConfigError, LayoutExploreError, checks_arguments, shortened
from layoutexplore.frontiers.decision import Predictor
from layoutexplore.options import Options, format_spec, format_value, option
from layoutexplore.plugins.registry import Registry
from layoutexplore.predictors.floor_model.completion import MOST_AHEAD
from layoutexplore.predictors.learned import LearnedPredictor
from layoutexplore.predictors.oracle import FALSE_CLOSED_AREA, OraclePredictor
from layoutexplore.predictors.own_predictor import predictor_of_own_code
from layoutexplore.predictors.protocol import RoomLabels, RoomPredictor, with_classes
from layoutexplore.predictors.reconstructed import predictor_of_method
from layoutexplore.predictors.shape_baselines import (
    FaceSubsetPredictor,
    Outline,
    ShapePredictor,
    hull_outline,
    parallel_outline,
    rectangle_outline,
)

__all__ = [
    "FALSE_CLOSED_AREA",
    "PREDICTORS",
    "OraclePredictor",
    "RoomLabels",
    "RoomPredictor",
    "make_predictor",
    "make_room_predictor",
    "predictor_inside",
    "predictor_names",
    "register_predictor",
    "with_classes",
]


@dataclass(frozen=True, kw_only=True)
class OracleOptions(Options):
    """Parameters of `oracle`."""

    flip: float = option(0.0, "probability that a room is judged wrongly", low=0.0, high=1.0)
    horizon: str = option("0", "doors beyond what is seen up to which the plan is foreseen: 0, 1, ... or inf")
    within: str = option("inf", "metres beyond known floor up to which it is foreseen, or inf")
    wrong: float = option(0.0, "share of what is foreseen that is the contrary", low=0.0, high=1.0)

    def __post_init__(self) -> None:
        """Numbers that may be infinite are texts: equal ones become one text."""
        super().__post_init__()
        for name in ("horizon", "within"):
            with suppress(ValueError):  # what is no number is told when the predictor is made
                object.__setattr__(self, name, format_value(float(getattr(self, name))))


@dataclass(frozen=True, kw_only=True)
class LearnedOptions(Options):
    """Parameters of `layout` and `learned`."""

    model: str = option("", "folder of models of one's own")
    network: str = option("on", "whether the networks have a say", choices=("on", "off"))
    rooms: str = option("doorways", "the layout method whose rooms are completed")
    ahead: float = option(
        0.0,
        "metres beyond known floor that are foreseen once no open frontier is left",
        low=0.0,
        high=MOST_AHEAD,
    )


@dataclass(frozen=True, kw_only=True)
class ReconstructOptions(Options):
    """Parameters of `reconstruct`."""

    method: str = option("rose2", "a layout method, its options behind semicolons", whole=True)


@dataclass(frozen=True, kw_only=True)
class PriorOptions(Options):
    """Parameters of `prior`."""

    plan: str = option(
        "true",
        "a floor plan or picture, or a preset (true, rough, corridors, other-floor, wrong, mirrored, empty); "
        "behind semicolons scale, rotation, mirror, here, among, sure",
        whole=True,
    )


def _shape(outline: Outline | None) -> Callable[[str, Options], RoomPredictor]:
    return lambda name, _: ShapePredictor(name, outline)


def _register_shipped() -> None:
    shapes: dict[str, tuple[str, Outline | None]] = {
        "none": ("no prediction; asked for rooms, what is seen of them", None),
        "rectangle": ("the seen part of a room, completed to a rectangle", rectangle_outline),
        "hull": ("the seen part of a room, completed to its convex hull", hull_outline),
        "parallel-wall": ("the wall across from a seen one completes a room", parallel_outline),
    }
    for shape, (doc, outline) in shapes.items():
        PREDICTORS.ship(shape, doc, _shape(outline), Options())
    PREDICTORS.ship(
        "face-subset",
        "the best union of faces of the walls' lines (after Luperto, Arcerito and Amigoni)",
        lambda name, _: FaceSubsetPredictor(),
        Options(),
    )
    PREDICTORS.ship(
        "oracle",
        "the true rooms: the ceiling of prediction",
        lambda name, options: OraclePredictor(
            flip=options.flip,
            horizon=_number("horizon is a number of doors, 0, 1, ... or inf", options.horizon),
            within=_number("within is a distance in metres above 0, or inf", options.within),
            wrong=options.wrong,
        ),
        OracleOptions(),
    )
    PREDICTORS.ship(
        "reconstruct",
        "the rooms of a layout method, completed",
        lambda name, options: predictor_of_method(options.method),
        ReconstructOptions(),
    )
    PREDICTORS.ship(
        "prior",
        "a plan known beforehand, registered with the map: prior:FILE, or a preset made from the run's plan",
        _prior,
        PriorOptions(),
    )
    learned = {
        "layout": "learnt: trees and networks over frontiers and cells",
        "learned": "the same models over the rooms of any layout method",
    }
    for name, doc in learned.items():
        PREDICTORS.ship(name, doc, _learned, LearnedOptions())


def _number(what: str, text: str) -> float:
    """A number of `oracle`, or infinity."""
    try:
        return float(text)
    except ValueError as error:
        raise ConfigError(f"oracle: {what}, got {shortened(text)}") from error


def _learned(name: str, options: LearnedOptions) -> LearnedPredictor:
    called = name.partition(":")[0]
    folder = Path(options.model) if options.model else None
    return LearnedPredictor(
        folder, network=options.network == "on", rooms=options.rooms, called=called, ahead=options.ahead
    )


def _prior(name: str, options: PriorOptions) -> RoomPredictor:
    # Registration with what it stands on takes 10 MB, which other predictors do without.
    from layoutexplore.predictors.prior_plan import predictor_of_prior

    del name
    return predictor_of_prior(options.plan)


PREDICTORS: Registry[RoomPredictor] = Registry(
    "predictor", "layoutexplore.predictors", predictor_of_own_code, module=__name__
)
"""Every predictor by name."""

_register_shipped()


def register_predictor(name: str, doc: str, build: Callable[..., Any], options: Any = None) -> None:
    """Make a predictor known by name.

    Args:
        name: Lower-case words joined by "-".
        doc: What it does, in one line.
        build: Called with the full name and the options. Without options, a class or function whose own
            parameters, all with defaults, are the options.
        options: The options it has unless told otherwise: a child of `layoutexplore.options.Options`.

    Raises:
        ConfigError: The name is taken by something else.
    """
    PREDICTORS.register(name, doc, build, options)


def predictor_names() -> list[str]:
    """The names that `make_predictor` knows."""
    return PREDICTORS.names()


@checks_arguments
def predictor_inside(text: str) -> str:
    """A predictor's name as it stands inside an agent's: what means the same has one name.

    Numbers are written in one way, options stand in their order behind semicolons, and those of their
    default are left out. Names without options, of prior plans and of code in files of one's own stay as
    they are, and so does what cannot be read: that is told when the predictor is made.

    Args:
        text: The name that was given.

    Example:
        >>> predictor_inside("oracle:horizon=1;flip=0.10"), predictor_inside("layout:network=on")
        ('oracle:flip=0.1;horizon=1', 'layout')
    """
    name = text.partition(":")[0]
    if "=" not in text or name == "prior" or name not in predictor_names():
        return text
    try:
        entry, options = PREDICTORS.find(text)
        if isinstance(options, ReconstructOptions):
            return predictor_of_method(options.method).name
    except LayoutExploreError:
        return text
    return format_spec(entry.name, options, entry.options).replace(",", ";")


def make_predictor(spec: object) -> Predictor | None:
    """A predictor from `NAME`, `NAME:key=value,...`, `FILE.py:CLASS` or `package.module:CLASS`.

    None for "none", and for None. What is a predictor already is handed back, with what it need not write
    itself; a class of a user's own is made without arguments.

    Raises:
        UnknownNameError: There is no predictor of that name.
        ConfigError: It has no such parameter, or the value makes no sense.
        OwnCodeError: A user's own predictor cannot be loaded.

    Example:
        >>> make_predictor("oracle:flip=0.25").name
        'oracle:flip=0.25'
        >>> make_predictor("none")
    """
    if spec is None or (isinstance(spec, str) and spec == "none"):
        return None
    return make_room_predictor(spec)


def make_room_predictor(spec: object) -> RoomPredictor:
    """Like `make_predictor`, but "none" is a predictor too: rooms are what is seen of them.

    Raises:
        UnknownNameError: There is no predictor of that name.
        ConfigError: It has no such parameter, or the value makes no sense.
        OwnCodeError: A user's own predictor cannot be loaded.
    """
    if not isinstance(spec, str):
        made = spec() if isinstance(spec, type) else spec
        return predictor_of_own_code(type(made).__name__, made)
    return PREDICTORS.make(spec)
