"""Where a plan may lie: what is seen, laid onto the plan in every orientation, scale and position.

For each of four orientations (eight with mirrored ones) and each scale, the scores of all positions come from
one product of Fourier transforms: points of seen walls count where the plan has walls, points of seen floor
where it has floor. The best positions are refined and compared by their likelihood.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
import scipy  # its parts are loaded where they are used

from layoutexplore.errors import checks_making
from layoutexplore.grids.arrays import Floats, Floats32, Ints
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

SPECTRA = 4
"""Transforms of what is seen that are kept: a plan turned by 90 degrees needs another size."""


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


def make_gains(fields: PlanFields) -> tuple[Floats32, Floats32]:
    """Gains of a seen wall and of seen floor over those outside of the plan, at half a coarse cell."""
    far = np.minimum(fields.to_walls, 10 * COARSE_STD)
    likely = (1 - OUTLIERS) * np.exp(-0.5 * (far / COARSE_STD) ** 2) + OUTLIERS
    walls = np.log(likely) - math.log(OUTLIERS)
    cost = np.clip((FLOOR_REACH - fields.depth) / FLOOR_REACH, 0.0, 1.0)
    cost[fields.depth < -SILENT] = SILENT_SHARE
    floor = FLOOR_WEIGHT * FLOOR_COST * (SILENT_SHARE - cost)
    step = max(1.0, COARSE / 2 / fields.cell)
    shape = tuple(max(1, round(n / step)) for n in walls.shape[::-1])
    first, second = (
        np.asarray(cv2.resize(image.astype(np.float32), shape, interpolation=cv2.INTER_AREA), np.float32)
        for image in (walls, floor)
    )
    return first, second


@checks_making
class CoarseSearch:
    """A search for one state of the map.

    Args:
        fields: The plan.
        gains: Of the plan, as of `make_gains`.
        evidence: What is seen.
        direction: Of the seen walls, radians.
    """

    def __init__(
        self, fields: PlanFields, gains: tuple[Floats32, Floats32], evidence: Evidence, direction: float
    ) -> None:
        self._fields, self._images, self.direction = fields, gains, direction
        self._centre = evidence.centre
        c, s = math.cos(direction), math.sin(direction)
        to_axes = np.array([[c, -s], [s, c]])
        self._walls, self._floor = ((p - self._centre) @ to_axes for p in (evidence.walls, evidence.floor))
        both = np.concatenate([self._walls, self._floor])
        self._low = np.floor(both.min(axis=0) / COARSE) if len(both) else np.zeros(2)
        high = np.floor(both.max(axis=0) / COARSE) if len(both) else np.zeros(2)
        self._size = (high - self._low).astype(int)[::-1] + 1
        self._spectra: dict[tuple[int, int], tuple[np.ndarray, np.ndarray]] = {}

    def cost(self, part: Slice) -> int:
        """Cells of its transforms."""
        rows, cols = self._shape(self._box(part)[1])
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

    def _shape(self, drawn: tuple[int, int]) -> tuple[int, int]:
        """The size of the transforms of a drawn plan of that size."""
        return (
            scipy.fft.next_fast_len(drawn[0] + int(self._size[0]), True),
            scipy.fft.next_fast_len(drawn[1] + int(self._size[1]), True),
        )

    def _seen(self, shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
        """Conjugate transforms of the points' counts."""
        if shape not in self._spectra:
            found = []
            for points in (self._walls, self._floor):
                cells = (np.floor(points / COARSE) - self._low).astype(int)
                counts = np.bincount(cells[:, 1] * shape[1] + cells[:, 0], minlength=shape[0] * shape[1])
                found.append(np.conj(scipy.fft.rfft2(counts.reshape(shape).astype(np.float32))))
            if len(self._spectra) == SPECTRA:
                self._spectra.pop(next(iter(self._spectra)))
            self._spectra[shape] = found[0], found[1]
        return self._spectra[shape]

    def run(self, part: Slice) -> list[Candidate]:
        """The best positions of one orientation and scale."""
        low, (rows, cols) = self._box(part)
        shape, scale = self._shape((rows, cols)), part.factors
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
        product = scipy.fft.rfft2(drawn[0], shape) * walls + scipy.fft.rfft2(drawn[1], shape) * floor
        places, scores = _peaks(scipy.fft.irfft2(product, shape))
        # Beyond the plan's size an offset is a negative one: the map hangs out at the low side.
        places -= np.where(places >= (rows, cols), shape, 0)
        # Cell `self._low` of the seen points lies at cell (row, col) of the plan.
        axes = low + (places[:, ::-1] - self._low) * COARSE
        shifts = (axes * scale) @ turn.T
        fixed = np.append(np.log(scale), self.direction)
        return [
            Candidate(score, part, Placement(turn, np.concatenate([fixed, b]), self._centre))
            for score, b in zip(scores.tolist(), shifts, strict=True)
        ]


def _peaks(scores: Floats32) -> tuple[Ints, Floats32]:
    """The highest places that lie apart, (row, col) int64 (n, 2), and their scores; scores are used up."""
    places, heights = np.empty((PEAKS, 2), np.int64), np.empty(PEAKS, np.float32)
    reach = round(APART / COARSE)
    for n in range(PEAKS):
        r, c = divmod(int(scores.argmax()), scores.shape[1])
        places[n], heights[n] = (r, c), scores[r, c]
        scores[max(r - reach, 0) : r + reach + 1, max(c - reach, 0) : c + reach + 1] = -np.inf
    return places, heights
