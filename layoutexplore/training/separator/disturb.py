"""What is done to a crop each time that it is learnt from: no two steps show the network the same map.

Recorded maps differ from simulated ones in ways that nobody has listed. So sizes and angles change, pieces of
wall go missing or are taken for things, things stand about, parts are unseen, walls grow thick and thin.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from layoutexplore.grids.arrays import Bytes, Mask
from layoutexplore.grids.grid import in_cells
from layoutexplore.layout.merging.separator.planes import FINE
from layoutexplore.training.separator.examples import SeparatorExample

AS_IT_IS, OFTEN = 0.25, 0.35
"""Share of the crops that nothing is done to; and how often each thing is done to another."""

SCALE, TURN = 1.25, 5.0
"""Crops grow or shrink by up to this factor and turn by up to so many degrees."""

HOLES, SPECKS, BLINDS = 40, 60, 4
"""Pieces of wall that are missing, things, and unseen parts of a crop, at most."""

HOLE, SPECK, BLIND = (0.2, 2.5), (0.1, 0.8), (2.0, 8.0)
"""Sides of these [m]."""

THIN = 0.3
"""Walls keep at least this share of their obstacles."""

T = TypeVar("T", bound=np.integer[Any])

Parts = Iterator[tuple[slice, slice]]


def disturbed(crop: SeparatorExample, rng: np.random.Generator) -> SeparatorExample:
    """A crop as the network may meet it; what is true of its squares stays so.

    Args:
        crop: A crop.
        rng: Source of randomness.
    """
    if rng.random() < AS_IT_IS:
        return crop
    if rng.random() < OFTEN:
        crop = _resized(crop, rng)
    shares = crop.shares.copy()
    for change in CHANGES:
        if rng.random() < OFTEN:
            change(shares, rng)
    return replace(crop, shares=shares)


def _resized(crop: SeparatorExample, rng: np.random.Generator) -> SeparatorExample:
    """A crop grown or shrunk and turned about its middle, unknown beyond."""
    scale, turn = SCALE ** float(rng.uniform(-1, 1)), float(rng.uniform(-TURN, TURN))
    return SeparatorExample(
        _moved(crop.shares, scale, turn, cv2.INTER_LINEAR),
        _moved(crop.rooms, scale, turn, cv2.INTER_NEAREST),
        _moved(crop.thing, scale, turn, cv2.INTER_NEAREST),
        _moved(crop.thing_weight, scale, turn, cv2.INTER_NEAREST),
    )


def _moved(values: NDArray[T], scale: float, turn: float, how: int) -> NDArray[T]:
    """Squares grown by `scale` and turned by degrees, 0 beyond: (rows, cols, ...) as given."""
    high, wide = values.shape[:2]
    matrix = cv2.getRotationMatrix2D(((wide - 1) / 2, (high - 1) / 2), turn, scale)
    return np.asarray(cv2.warpAffine(values, matrix, (wide, high), flags=how), values.dtype)


def _boxes(around: Mask, most: int, sides: tuple[float, float], rng: np.random.Generator) -> Parts:
    """Up to so many boxes with their middles on some squares."""
    places = np.argwhere(around)
    count = int(rng.integers(most)) + 1 if len(places) else 0
    for row, col in places[rng.integers(max(len(places), 1), size=count)]:
        high, wide = (in_cells(float(rng.uniform(*sides)), FINE) for _ in range(2))
        top, left = max(int(row) - high // 2, 0), max(int(col) - wide // 2, 0)
        yield slice(top, top + high), slice(left, left + wide)


def _holes(shares: Bytes, rng: np.random.Generator) -> None:
    """Pieces of wall give way to free space, or are unseen."""
    to_free = rng.random() < 0.7
    for part in _boxes(shares[..., 1] > 0, HOLES, HOLE, rng):
        if to_free:
            shares[(*part, 0)] += shares[(*part, 1)] + shares[(*part, 2)]
        shares[(*part, slice(1, 3))] = 0


def _taken_for_things(shares: Bytes, rng: np.random.Generator) -> None:
    """Pieces of wall are taken for other obstacles, or the other way round."""
    wall, thing = (1, 2) if rng.random() < 0.7 else (2, 1)
    for part in _boxes(shares[..., wall] > 0, HOLES, HOLE, rng):
        shares[(*part, thing)] += shares[(*part, wall)]
        shares[(*part, wall)] = 0


def _specks(shares: Bytes, rng: np.random.Generator) -> None:
    """Things stand in free space."""
    for part in _boxes(shares[..., 0] > 0, SPECKS, SPECK, rng):
        shares[(*part, 2)] += shares[(*part, 0)]
        shares[(*part, 0)] = 0


def _blinds(shares: Bytes, rng: np.random.Generator) -> None:
    """Parts have not been seen."""
    for part in _boxes(shares[..., 0] > 0, BLINDS, BLIND, rng):
        shares[part] = 0


def _no_gaps(shares: Bytes, rng: np.random.Generator) -> None:
    """Door gaps are not found."""
    for part in _boxes(shares[..., 3] > 0, HOLES, BLIND, rng):
        shares[(*part, 3)] = 0


def _thickness(shares: Bytes, rng: np.random.Generator) -> None:
    """Walls are wider by a square, or let some light through."""
    walls = shares[..., 1]
    if rng.random() < 0.5:
        wider = np.asarray(cv2.dilate(walls, np.ones((2, 2) if rng.random() < 0.7 else (3, 3), np.uint8)))
        grown = np.minimum(wider - walls, shares[..., 0])
        shares[..., 1] += grown
        shares[..., 0] -= grown
        return
    kept = float(rng.uniform(THIN, 1))
    lost = walls - np.asarray(np.where(rng.random(walls.shape) < 0.5, walls * kept, walls), np.uint8)
    shares[..., 1] -= lost
    shares[..., 0] += lost


CHANGES: tuple[Callable[[Bytes, np.random.Generator], None], ...] = (
    _holes,
    _taken_for_things,
    _specks,
    _blinds,
    _no_gaps,
    _thickness,
)
