"""Stretching costs what plain sums say; the search finds the place of a plan."""

from __future__ import annotations

import numpy as np
import pytest

from layoutexplore.grids.arrays import Floats
from layoutexplore.priors.evidence import Evidence, seen_points, wall_direction
from layoutexplore.priors.fields import make_fields
from layoutexplore.priors.plan import prior_of_plan
from layoutexplore.priors.refinement import Placement, fit_points, matrix_of
from layoutexplore.priors.search import CoarseSearch, make_gains, slices
from layoutexplore.priors.warp import SHIFT_STD, STRETCH_STD, WarpedPlacement, bent
from tests.priors.cases import office, seen_part


def begun(evidence: Evidence, shift: tuple[float, float], turned: float = 0.0) -> Placement:
    """The plan's own place, shifted (metres) and turned (radians)."""
    prior = prior_of_plan(office())
    raster = office().rasterize(prior.resolution)
    c = evidence.centre
    b = c - (raster.origin.x, raster.origin.y) + shift
    return Placement(np.eye(2), np.array([0.0, 0.0, turned, *b]), c)


def off(placement: Placement, truth: Placement, points: Floats) -> float:
    (m, s), (n, t) = matrix_of(placement), matrix_of(truth)
    return float(np.hypot(*(points @ (m - n).T + s - t).T).max())


def test_stretching_costs_what_plain_sums_say_and_draws_walls_nearer() -> None:
    evidence, fields = seen_points(seen_part(office(), 0.9)), make_fields(prior_of_plan(office()))
    place = begun(evidence, (0.0, 0.0))
    walls = evidence.walls + 0.25 * np.sin(evidence.walls[:, ::-1] / 5.0)
    found, cost = bent(WarpedPlacement(place), walls, fields, 2)
    lattice = found.lattice
    assert lattice is not None
    shifts, plain = lattice.shifts, 0.0
    for r in range(shifts.shape[0]):
        for c in range(shifts.shape[1]):
            plain += float(shifts[r, c] @ shifts[r, c]) / SHIFT_STD**2
            for i, j in ((r + 1, c), (r, c + 1)):
                if i < shifts.shape[0] and j < shifts.shape[1]:
                    apart = shifts[r, c] - shifts[i, j]
                    plain += float(apart @ apart) / (STRETCH_STD * lattice.spacing) ** 2
    assert cost == pytest.approx(0.5 * plain)
    before, after = (
        fit_points(p.to_plan(walls), evidence.floor[:0], fields, 1.0).score
        for p in (WarpedPlacement(place), found)
    )
    assert after > before


def test_a_wide_and_a_tall_floor_are_stretched_alike() -> None:
    """The unknowns are numbered along the shorter side: transposing everything transposes the answer."""
    evidence, prior = seen_points(seen_part(office(), 0.9)), prior_of_plan(office())
    fields = make_fields(prior)
    flipped = make_fields(type(prior)(name="t", free=prior.free.T, room_ids=prior.room_ids.T, resolution=0.1))
    place = begun(evidence, (0.2, -0.1))
    swap = np.array([[0.0, 1.0], [1.0, 0.0]])
    parameters = np.array([0.0, 0.0, 0.0, *place.parameters[:2:-1]])
    other = Placement(np.eye(2), parameters, place.centre[::-1].copy())
    wide, cost = bent(WarpedPlacement(place), evidence.walls, fields, 1)
    tall, same = bent(WarpedPlacement(other), np.ascontiguousarray(evidence.walls @ swap), flipped, 1)
    assert wide.lattice is not None and tall.lattice is not None
    np.testing.assert_allclose(
        tall.lattice.shifts, wide.lattice.shifts.transpose(1, 0, 2)[..., ::-1], atol=1e-3
    )
    assert same == pytest.approx(cost, rel=1e-2)


def test_the_search_finds_the_place_and_remembers_few_transforms() -> None:
    evidence, fields = seen_points(seen_part(office(), 0.6)), make_fields(prior_of_plan(office()))
    direction = wall_direction(seen_part(office(), 0.6).free)
    search = CoarseSearch(fields, make_gains(fields), evidence, direction)
    found = [
        c
        for part in slices(np.array([-0.12, 0.0, 0.12]), (0, 1, 2, 3), (False, True))
        for c in search.run(part)
    ]
    best = max(found, key=lambda c: c.score)
    assert best.slice.log_scale == 0.0 and not best.slice.mirrored
    assert off(best.placement, begun(evidence, (0.0, 0.0)), evidence.walls) < 1.5
