"""Routes that are repaired where a piece is cut out."""

from __future__ import annotations

import numpy as np
import pytest

from layoutexplore.agents.omniscient.route import cheapest_gaps


def test_cheapest_gaps_against_trying_all() -> None:
    rng = np.random.default_rng(1)
    near = rng.uniform(1, 9, (4, 50)).astype(np.float32)
    lengths, to, on = rng.uniform(1, 5, 3), rng.uniform(1, 2, 4), rng.uniform(1, 2, 4)
    added, gaps = cheapest_gaps(near, lengths, to, on)
    for k in range(50):
        tried = [
            to[i] * near[i, k] + (on[i] * (near[i + 1, k] - lengths[i]) if i < 3 else 0.0) for i in range(4)
        ]
        assert added[k] == pytest.approx(min(tried)) and gaps[k] == int(np.argmin(tried))
