"""Pictures of registered plans."""

from __future__ import annotations

import numpy as np

from layoutexplore.drawing import palette
from layoutexplore.drawing.prior_plans import CAPTION, GAP, draw_registered, side_by_side
from layoutexplore.priors.plan import prior_of_plan
from layoutexplore.priors.registration import Registration
from tests.priors.cases import office, seen_part


def colours(image: np.ndarray) -> set[tuple[int, ...]]:
    return set(map(tuple, np.unique(image.reshape(-1, 3), axis=0).tolist()))


def test_a_plan_in_its_place_agrees_and_foresees() -> None:
    grid = seen_part(office(), 0.5)
    registration = Registration(prior_of_plan(office()))
    registration.update(grid)
    track = np.array([(1.0, 6.0, 0.0), (9.0, 6.0, 0.0)])
    image = draw_registered(grid, registration, 1.0, track, scale=2)
    assert image.shape == (2 * grid.shape[0] + CAPTION, 2 * grid.shape[1], 3)
    found = colours(image)
    assert {palette.PREDICTED, palette.BLUE, palette.WALL, palette.GREEN} <= found
    assert palette.VERMILLION not in found
    half = image[CAPTION:, : image.shape[1] // 2 - 20]  # the caption says what colours mean
    assert palette.PREDICTED not in colours(half)


def test_without_a_place_only_the_map_is_drawn() -> None:
    grid = seen_part(office(), 0.0)
    registration = Registration(prior_of_plan(office()))
    registration.update(grid)
    assert palette.PREDICTED not in colours(draw_registered(grid, registration, 0.0, np.zeros((0, 3))))


def test_side_by_side() -> None:
    left, right = np.zeros((100, 50, 3), np.uint8), np.full((200, 300, 3), 9, np.uint8)
    image = side_by_side(left, right)
    assert image.shape == (200, 100 + GAP + 300, 3)
    assert (image[:, :100] == 0).all() and (image[:, 100 + GAP :] == 9).all()
