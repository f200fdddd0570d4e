"""The forest that says whether two regions are one room: plain numbers in a JSON file beside this module.

How the one that ships was trained, and what it reaches, is told in `merging_model.md`.
"""

from __future__ import annotations

from pathlib import Path

from layoutexplore.layout.merging.pair_features import FEATURES
from layoutexplore.models.forest import Forest
from layoutexplore.models.forest_files import load_forests, save_forests

MODEL_PATH = Path(__file__).with_name("merging_model.json")
"""The shipped model; `layoutexplore.training.room_merging` makes it."""

_NAME = "one_room"


def save_forest(forest: Forest, path: Path, *, note: str = "") -> None:
    """Write a forest.

    Raises:
        MapError: The file cannot be written.
    """
    save_forests(path, {_NAME: forest}, FEATURES, note, double=True)


def load_forest(path: Path = MODEL_PATH) -> Forest:
    """Read a forest; that of an unchanged file only once.

    Raises:
        ConfigError: The file cannot be read, is damaged, or was made for other features.
    """
    return load_forests(path, FEATURES, (_NAME,), double=True)[_NAME]
