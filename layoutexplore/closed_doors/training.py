"""Training of the trees that judge rectangles behind closed doors, from maps whose shut rooms are known."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from layoutexplore.closed_doors.candidates import FEATURES, Scene
from layoutexplore.closed_doors.doors import Door
from layoutexplore.closed_doors.prediction import AGREEMENT, MODEL, door_scenes
from layoutexplore.grid import FREE
from layoutexplore.predictors.forest import Forest, save_forests
from layoutexplore.predictors.training import as_forest

_TEACHES = 0.3  # doors behind which no rectangle agrees better say nothing about which rectangle to choose


@dataclass(frozen=True, eq=False)
class Samples:
    """Rectangles behind doors.

    Attributes:
        features: float32 (n, features).
        agreement: float32 (n,), intersection over union with the unseen rooms touched.
        weight: float32 (n,), less for each where a door has many.
    """

    features: NDArray[np.float32]
    agreement: NDArray[np.float32]
    weight: NDArray[np.float32]


def collect(cells: NDArray[np.int8], truth: NDArray[np.int8], resolution: float) -> Samples:
    """The rectangles behind the doors of a map, with their agreement with the truth in the same frame."""
    hidden = (truth == FREE) & (cells != FREE)
    _, rooms = cv2.connectedComponents(hidden.astype(np.uint8), connectivity=4)
    features = [np.empty((0, len(FEATURES)))]
    agreement, weight = [np.empty(0)], [np.empty(0)]
    for turns, scene, door in door_scenes(cells, resolution):
        boxes = scene.rectangles(door)
        if not len(boxes):
            continue
        agreed = _agreement(scene, door, boxes, np.rot90(hidden, turns), np.rot90(rooms, turns))
        if agreed.max() <= _TEACHES:
            continue
        features.append(scene.features(door, boxes))
        agreement.append(agreed)
        weight.append(np.full(len(boxes), len(boxes) ** -0.5))
    return Samples(*(np.concatenate(part).astype(np.float32) for part in (features, agreement, weight)))


def _agreement(
    scene: Scene, door: Door, boxes: NDArray[np.int64], hidden: NDArray[np.bool_], rooms: NDArray[np.int32]
) -> NDArray[np.float64]:
    """Hidden cells of each rectangle over the rectangle and the room behind the door together."""
    behind = rooms[max(door.row - 6, 0) : door.row + 1, door.start : door.stop]
    ids, counts = np.unique(behind[behind > 0], return_counts=True)
    room = np.isin(rooms, ids[counts > 30])
    if not room.any():
        return np.zeros(len(boxes))
    top, left, bottom, right = boxes.T

    def inside(mask: NDArray[np.bool_]) -> NDArray[np.int64]:
        s = np.pad(mask, ((1, 0), (1, 0))).cumsum(0).cumsum(1).astype(np.int64)
        return np.asarray(s[bottom, right] - s[top, right] - s[bottom, left] + s[top, left])

    size = scene.count("possible", boxes)
    return np.asarray(inside(hidden & scene.possible) / np.maximum(size + room.sum() - inside(room), 1))


def fit(samples: Iterable[Samples]) -> Forest:
    """Train the trees on the samples of several maps."""
    from sklearn.ensemble import HistGradientBoostingRegressor

    parts = list(samples)
    model = HistGradientBoostingRegressor(
        max_iter=120, learning_rate=0.06, max_leaf_nodes=12, min_samples_leaf=60, l2_regularization=3.0, max_features=0.4,
        random_state=0, early_stopping=False,
    )  # fmt: skip
    columns = (np.concatenate([getattr(p, name) for p in parts]) for name in ("features", "agreement", "weight"))
    return as_forest(model.fit(*columns))


def save(forest: Forest, note: str) -> None:
    """Make the trees the shipped ones."""
    save_forests(MODEL, {AGREEMENT: forest}, FEATURES, note)
