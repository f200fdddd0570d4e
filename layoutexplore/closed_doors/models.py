"""The trees behind the prediction of rooms behind closed doors."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from layoutexplore.closed_doors.doors import DOOR_FEATURES
from layoutexplore.closed_doors.features import FEATURES
from layoutexplore.models.forest import Forest
from layoutexplore.models.forest_files import load_forests

DOOR_MODEL, ROOM_MODEL = (Path(__file__).with_name(name) for name in ("doors.json", "rooms.json"))
"""The shipped trees."""

DOOR, AGREEMENT = "door", "agreement"
"""Names of the trees in their files."""


@dataclass(frozen=True, eq=False)
class Models:
    """What the prediction asks.

    Attributes:
        doors: Log-odds that an edge is a closed door, from `DOOR_FEATURES`.
        rooms: Agreement of a rectangle with the room behind a door, from `FEATURES`.
    """

    doors: Forest
    rooms: Forest


@lru_cache(maxsize=1)
def shipped_models() -> Models:
    """The models that ship."""
    return Models(
        load_forests(DOOR_MODEL, DOOR_FEATURES)[DOOR], load_forests(ROOM_MODEL, FEATURES)[AGREEMENT]
    )
