"""Random grids that the tests of predictors share."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from layoutexplore.predictors.seen_rooms import Regions

grids = hnp.arrays(
    np.int8, st.tuples(st.integers(3, 24), st.integers(3, 24)), elements=st.sampled_from([-1, 0, 0, 100])
)


wide = st.builds(
    lambda coarse, size: coarse.repeat(size, axis=0).repeat(size, axis=1),
    hnp.arrays(
        np.int8,
        st.tuples(st.integers(2, 5), st.integers(2, 8)),
        elements=st.sampled_from([-1, -1, -1, 0, 0, 100]),
    ),
    st.integers(3, 6),
)
"""Grids with long stretches without walls."""


def nothing_seen(shape: tuple[int, int]) -> Regions:
    return Regions(np.zeros(shape, np.int32), 0, np.zeros(shape, np.float32))
