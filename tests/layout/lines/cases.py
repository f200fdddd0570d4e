"""Random lines and segments that the tests of this folder share."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from layoutexplore.layout.lines.faces import arrange, clip_lines
from layoutexplore.layout.lines.segments import AlignedSegments

BOX = (0.5, 1.0, 9.5, 7.0)


DIRECTIONS = np.array([0.0, 0.7, np.pi / 2, 2.9])


lines = st.lists(st.tuples(st.integers(0, 3), st.floats(-8, 8, allow_nan=False)), max_size=12)


seeds = st.integers(0, 2**32 - 1)


def arrangement_of(drawn):
    direction = np.array([d for d, _ in drawn], np.int64)
    offset = np.array([t for _, t in drawn], np.float64)
    return arrange(clip_lines(DIRECTIONS[direction], offset, BOX))


def random_segments(seed, n=40):
    rng = np.random.default_rng(seed)
    start = rng.uniform(0, 8, n)
    return AlignedSegments(
        directions=DIRECTIONS,
        direction=rng.integers(0, 3, n),
        offset=rng.uniform(0, 3, n).round(2),
        start=start,
        end=start + rng.uniform(0.1, 2, n),
    )
