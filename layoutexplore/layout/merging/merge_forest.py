"""The forest that says whether two regions are one room: plain numbers in a JSON file beside this module.

How the one that ships was trained, and what it reaches, is told in `merging_model.md`.
"""

from __future__ import annotations

from pathlib import Path

from layoutexplore.layout.merging.pair_features import FEATURES
from layoutexplore.models.forest_files import ForestKind

PAIR_FOREST = ForestKind("one_room", FEATURES, Path(__file__).with_name("merging_model.json"))
"""The classifier of pairs; `layoutexplore.training.room_merging` makes it."""
