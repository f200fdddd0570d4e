"""Where a plan may lie: what is seen, laid onto the plan in every orientation, scale and position.

For each of four orientations (eight with mirrored ones) and each scale, the scores of all positions come from
one product of Fourier transforms: points of seen walls count where the plan has walls, points of seen floor
where it has floor. The best positions are refined and compared by their likelihood.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from scipy import fft

from layoutexplore.grids.arrays import Floats, Floats32
from layoutexplore.priors.evidence import Evidence
from layoutexplore.priors.fields import PlanFields
from layoutexplore.priors.refinement import (
    FLOOR_COST,
    FLOOR_REACH,
    FLOOR_WEIGHT,
    OUTLIERS,
    SILENT,
    SILENT_SHARE,
    Placement,
)

COARSE = 0.7
"""Metres a cell of the search."""

COARSE_STD = 0.5
"""Metres by which walls may be off in the search."""

SCALE_STEP = 0.06
"""Step of the scale's logarithm."""

APART = 2.0
"""Metres between positions that are kept of one orientation and scale."""

PEAKS = 3
"""Positions kept of each."""


@dataclass(frozen=True)
class Slice:
    """One orientation and scale.

    Attributes:
        quarter: Turns of the building's axes by 90 degrees, 0..3.
        mirrored: Whether the plan is.
        log_scale: Logarithm of plan metres a world metre.
        aspect: Logarithm of the ratio of that along the building's first axis to that along the second.
    """

    quarter: int
    mirrored: bool
    log_scale: float
    aspect: float = 0.0

    @property
    def factors(self) -> Floats:
        """float64 (2,): plan metres a world metre along the building's axes."""
        return np.exp(self.log_scale + 0.5 * self.aspect * np.array([1.0, -1.0]))

    def turn(self, direction: float) -> Floats:
        """Q of a placement, float64 (2, 2), in a plan with walls in that direction (radians)."""
        angle = direction + self.quarter * math.pi / 2
        c, s = math.cos(angle), math.sin(angle)
        return np.array([[c, -s], [s, c]]) @ np.diag([-1.0 if self.mirrored else 1.0, 1.0])


@dataclass(frozen=True, eq=False)
class Candidate:
    """A place that the search found.

    Attributes:
        score: As of the search.
        slice: Orientation and scale.
        placement: Where.
    """

    score: float
    slice: Slice
    placement: Placement


def slices(log_scales: Floats, quarters: tuple[int, ...], mirrored: tuple[bool, ...]) -> Iterator[Slice]:
    """All orientations and scales, the likeliest scales first."""
    for log_scale in sorted(log_scales.tolist(), key=abs):
        for flipped in mirrored:
            for quarter in quarters:
                yield Slice(quarter, flipped, log_scale)


class CoarseSearch:
    """A search for one state of the map.

    Args:
        fields: The plan.
        evidence: What is seen.
        direction: Of the seen walls, radians.
    """

    def __init__(self, fields: PlanFields, evidence: Evidence, direction: float) -> None:
        self._fields, self.direction = fields, direction
        self._centre = evidence.centre
        c, s = math.cos(direction), math.sin(direction)
        to_axes = np.array([[c, -s], [s, c]])
        self._walls, self._floor = ((p - self._centre) @ to_axes for p in (evidence.walls, evidence.floor))
        both = np.concatenate([self._walls, self._floor])
        self._low = np.floor(both.min(axis=0) / COARSE) if len(both) else np.zeros(2)
        high = np.floor(both.max(axis=0) / COARSE) if len(both) else np.zeros(2)
        self._size = (high - self._low).astype(int)[::-1] + 1
        self._spectra: dict[tuple[int, int], tuple[np.ndarray, np.ndarray]] = {}

    @cached_property
    def _images(self) -> tuple[Floats32, Floats32]:
        """Gains of a seen wall and of seen floor over those outside of the plan, at half a coarse cell."""
        cell = self._fields.cell
        likely = (1 - OUTLIERS) * np.exp(-0.5 * (self._fields.to_walls / COARSE_STD) ** 2) + OUTLIERS
        walls = np.log(likely) - math.log(OUTLIERS)
        cost = np.clip((FLOOR_REACH - self._fields.depth) / FLOOR_REACH, 0.0, 1.0)
        cost[self._fields.depth < -SILENT] = SILENT_SHARE
        floor = FLOOR_WEIGHT * FLOOR_COST * (SILENT_SHARE - cost)
        step = max(1.0, COARSE / 2 / cell)
        shape = tuple(max(1, round(n / step)) for n in walls.shape[::-1])
        small = (
            cv2.resize(image.astype(np.float32), shape, interpolation=cv2.INTER_AREA)
            for image in (walls, floor)
        )
        first, second = small
        return first, second

    def cost(self, part: Slice) -> int:
        """Cells of its transforms."""
        rows, cols = self._shape(part)
        return rows * cols

    def _box(self, part: Slice) -> tuple[Floats, tuple[int, int]]:
        """The low corner of the plan in the building's axes about the centre, its size in coarse cells."""
        rows, cols = self._fields.free.shape
        span = np.array([cols, rows]) * self._fields.cell
        corners = self._fields.low + np.array([[0, 0], [1, 0], [0, 1], [1, 1]]) * span
        axes = corners @ part.turn(self._fields.direction) / part.factors
        low = axes.min(axis=0)
        size = np.ceil((axes.max(axis=0) - low) / COARSE).astype(int)[::-1]
        return low, (int(size[0]), int(size[1]))

    def _shape(self, part: Slice) -> tuple[int, int]:
        _, (rows, cols) = self._box(part)
        return (
            fft.next_fast_len(rows + int(self._size[0]), True),
            fft.next_fast_len(cols + int(self._size[1]), True),
        )

    def _seen(self, shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
        """Conjugate transforms of the points' counts."""
        if shape not in self._spectra:
            found = []
            for points in (self._walls, self._floor):
                cells = (np.floor(points / COARSE) - self._low).astype(int)
                counts = np.zeros(shape, np.float32)
                np.add.at(counts, (cells[:, 1], cells[:, 0]), 1.0)
                found.append(np.conj(fft.rfft2(counts)))
            self._spectra = {shape: (found[0], found[1])}
        return self._spectra[shape]

    def run(self, part: Slice) -> list[Candidate]:
        """The best positions of one orientation and scale."""
        low, (rows, cols) = self._box(part)
        shape, scale = self._shape(part), part.factors
        turn = part.turn(self._fields.direction)
        images = self._images
        step = self._fields.free.shape[1] * self._fields.cell / images[0].shape[1]
        # Pixel (j, i) of the drawn plan -> axes -> plan metres -> pixel of the image.
        matrix = turn * scale * COARSE / step
        shift = (turn @ ((low + COARSE / 2) * scale) - self._fields.low) / step - 0.5
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        warp = np.column_stack([matrix, shift])
        drawn = [cv2.warpAffine(image, warp, (cols, rows), flags=flags) for image in images]
        walls, floor = self._seen(shape)
        product = fft.rfft2(drawn[0], shape) * walls + fft.rfft2(drawn[1], shape) * floor
        scores = fft.irfft2(product, shape)
        return [self._candidate(part, turn, low, place, scores) for place in _peaks(scores)]

    def _candidate(
        self, part: Slice, turn: Floats, low: Floats, place: tuple[int, int], scores: Floats32
    ) -> Candidate:
        rows, cols = scores.shape
        r, c = place
        drawn = self._box(part)[1]
        # Beyond the plan's size an offset is a negative one: the map hangs out at the low side.
        row, col = (r - rows if r >= drawn[0] else r), (c - cols if c >= drawn[1] else c)
        # Cell `self._low` of the seen points lies at cell (row, col) of the plan.
        axes = low + np.array([col, row]) * COARSE - self._low * COARSE
        b = turn @ (axes * part.factors)
        parameters = np.array([*np.log(part.factors), self.direction, b[0], b[1]])
        return Candidate(float(scores[r, c]), part, Placement(turn, parameters, self._centre))


def _peaks(scores: Floats32) -> list[tuple[int, int]]:
    """The highest places that lie apart, (row, col)."""
    work, found = scores.copy(), []
    reach = round(APART / COARSE)
    for _ in range(PEAKS):
        r, c = divmod(int(work.argmax()), work.shape[1])
        found.append((r, c))
        work[max(r - reach, 0) : r + reach + 1, max(c - reach, 0) : c + reach + 1] = -np.inf
    return found
