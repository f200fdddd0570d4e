"""What the separator network learns from: truth by squares, in the frame of what it sees."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import layoutexplore
from layoutexplore.layout.merging.separator.planes import KINDS, PATCH
from layoutexplore.training.separator import maps
from layoutexplore.training.separator.examples import separator_example
from layoutexplore.training.separator.maps import WEATHERED, known_maps, separator_examples
from tests.layout.merging.cases import plan, rooms_of


def test_truth_lies_where_the_network_sees_it() -> None:
    cells = plan()
    cells[80:84, 60:64] = 100
    example = separator_example(cells, rooms_of(plan()), 0.05)
    high, wide = example.rooms.shape
    assert example.shares.shape == (2 * high, 2 * wide, KINDS) and 2 * high % PATCH == 0
    free = example.shares.reshape(high, 2, wide, 2, KINDS).mean((1, 3))[..., 0] / 255
    # all that is free is in or near a room, and each room has about its area
    assert (example.rooms[free > 0.9] > 0).all()
    for room in (1, 2, 3):
        area = np.count_nonzero((example.rooms == room) & (free > 0.5)) * 0.04
        assert abs(area / (np.count_nonzero(rooms_of(plan()) == room) * 0.0025) - 1) < 0.1
    known = example.thing[example.thing_weight > 0]
    assert known.max() == 255 and 0 < np.count_nonzero(known) < 5, "one thing, all else is wall"


def test_the_same_seed_makes_the_same_maps() -> None:
    first, again = (
        [one for k in range(4) for one in known_maps(k, ("apartment-01",), seed=4)] for _ in range(2)
    )
    assert 0 < len(first) == len(again) and len(first) % (1 + WEATHERED) == 0
    for a, b in zip(first, again, strict=True):
        assert np.array_equal(a[0], b[0]) and np.array_equal(a[1], b[1]) and a[2] == b[2]
        assert a[0].shape == a[1].shape and (a[0] == 0).any()


def test_examples_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[int] = []
    cells = plan()

    def known(k: int, plans: Sequence[str], seed: int) -> list[maps.KnownMap]:
        made.append(k)
        return [(cells, rooms_of(cells), 0.05)] * (3 * (k != 1))

    monkeypatch.setattr(maps, "known_maps", known)
    first = separator_examples(2, cache=tmp_path)
    again = separator_examples(3, cache=tmp_path)
    assert made == [0, 1, 2] and len(first) == 3 and len(again) == 6
    for a, b in zip(first, again[:3], strict=True):
        for name in ("shares", "rooms", "thing", "thing_weight"):
            assert np.array_equal(getattr(a, name), getattr(b, name))
            assert getattr(a, name).dtype == getattr(b, name).dtype
    separator_examples(1, ("another",), cache=tmp_path)
    assert made == [0, 1, 2, 0], "other plans, other maps"
    for content in ("one", "another"):
        (tmp_path / "plan.geojson").write_text(content)
        separator_examples(1, (str(tmp_path / "plan.geojson"),), cache=tmp_path)
    assert made == [0, 1, 2, 0, 0, 0], "a plan that has been corrected, other maps"
    with monkeypatch.context() as later:
        later.setattr(layoutexplore, "__version__", "9.9")
        separator_examples(1, cache=tmp_path)
    assert made == [0, 1, 2, 0, 0, 0, 0], "another version, other maps"
    damaged = next(tmp_path.glob("*-2.npz"))
    damaged.write_bytes(damaged.read_bytes()[:100])
    with pytest.warns(UserWarning, match="made anew"):
        assert len(separator_examples(3, cache=tmp_path)) == 6


def test_the_parts_of_a_square_are_no_more_than_all_of_it() -> None:
    cells = plan()
    cells[80:84, 61:64] = 100
    shares = separator_example(cells, rooms_of(plan()), 0.05).shares[..., :3].sum(axis=-1, dtype=int)
    assert 253 <= shares.max() <= 255 and ((shares > 0) & (shares < 255)).any()
