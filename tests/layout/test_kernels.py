"""The kernels of the layout methods against slow, obvious versions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.signal import find_peaks
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from layoutexplore.grids.bitsets import count_bits, ones, set_bits, true_cells
from layoutexplore.grids.components import components
from layoutexplore.grids.flood import spread_in_place
from layoutexplore.layout.alignment import surfaces
from layoutexplore.layout.canonical import Posture
from layoutexplore.layout.lines.declutter import _circular_peaks
from layoutexplore.layout.lines.face_clusters import renumber
from layoutexplore.layout.lines.segments import AlignedSegments
from layoutexplore.layout.lines.walls import find_walls, grouped_median, merge_walls
from layoutexplore.layout.merging.agglomeration import FEATURE_COUNT
from layoutexplore.layout.merging.door_gaps import LONG, SHORT, WIDTH, OpeningConfig, find_openings, free_runs
from layoutexplore.layout.merging.merge_forest import load_forest
from layoutexplore.models.forest import log_odds

masks = hnp.arrays(np.bool_, st.tuples(st.integers(1, 12), st.integers(1, 150)), elements=st.booleans())
maps = hnp.arrays(
    np.int8, st.tuples(st.integers(1, 9), st.integers(1, 11)), elements=st.sampled_from([-1, 0, 100])
)


@settings(deadline=None)
@given(st.integers(0, 2**64 - 1))
def test_ones_are_the_set_bits_of_a_word(word: int) -> None:
    assert ones(np.uint64(word)) == word.bit_count()


@settings(max_examples=60, deadline=None)
@given(masks, st.integers(0, 3), st.integers(0, 10**6))
def test_bits_of_rows_and_columns_count_the_cells_of_a_stretch(
    mask: np.ndarray, slack: int, seed: int
) -> None:
    rows, cols = mask.shape
    rng = np.random.default_rng(seed)
    of_rows, of_cols = set_bits(np.flatnonzero(mask), rows, cols, slack)
    for bits, cells in ((of_rows, mask), (of_cols, mask.T)):
        for _ in range(5):
            row = int(rng.integers(len(cells)))
            begin, end = (int(v) for v in rng.integers(-20, cells.shape[1] + 20, 2))
            thick = cells[max(row - slack, 0) : row + slack + 1].any(axis=0)
            assert count_bits(bits, row, len(thick), begin, end) == np.count_nonzero(
                thick[max(begin, 0) : max(end, 0)]
            )


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 30), st.integers(0, 40), st.integers(0, 10**6))
def test_components_are_numbered_by_their_first_member(count: int, edges: int, seed: int) -> None:
    first, second = np.random.default_rng(seed).integers(0, count, (2, edges))
    found = components(first, second, count)
    _, slow = connected_components(
        coo_array((np.ones(edges), (first, second)), (count, count)), directed=False
    )
    firsts = [slow.tolist().index(s) for s in slow]
    assert found.tolist() == [sorted(set(firsts)).index(f) for f in firsts]


@settings(max_examples=40, deadline=None)
@given(st.lists(st.integers(-1, 6), max_size=20))
def test_groups_are_renumbered_by_first_appearance(group: list[int]) -> None:
    names: list[int] = []
    for g in group:
        if g >= 0 and g not in names:
            names.append(g)
    assert renumber(np.array(group, np.int64)).tolist() == [names.index(g) if g >= 0 else -1 for g in group]


@st.composite
def segment_sets(draw: st.DrawFn) -> AlignedSegments:
    n = draw(st.integers(1, 25))
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    start = rng.integers(0, 40, n) / 4
    return AlignedSegments(
        directions=np.array([0.0, 1.0]),
        direction=rng.integers(0, 2, n),
        offset=rng.integers(0, 12, n) / 4,
        start=start,
        end=start + rng.integers(1, 12, n) / 4,
    )


@settings(max_examples=60, deadline=None)
@given(segment_sets(), st.sampled_from([0.25, 0.6, 1.0]))
def test_walls_are_chains_of_near_segments(segments: AlignedSegments, gap: float) -> None:
    n = len(segments)
    apart = np.maximum(segments.start[:, None], segments.start) - np.minimum(
        segments.end[:, None], segments.end
    )
    aside = segments.offset[:, None] - segments.offset
    near = np.maximum(apart, 0) ** 2 + aside**2 <= gap**2
    near &= segments.direction[:, None] == segments.direction
    walls = find_walls(segments, gap)
    assert walls.group.tolist() == components(*np.nonzero(near), n).tolist()
    for k in range(len(walls)):
        inside = walls.group == k
        assert walls.start[k] == segments.start[inside].min() and walls.end[k] == segments.end[inside].max()
        assert walls.length[k] == pytest.approx(segments.length[inside].sum())
        assert {int(d) for d in segments.direction[inside]} == {int(walls.direction[k])}


@settings(max_examples=60, deadline=None)
@given(segment_sets(), st.sampled_from([0.3, 0.6, 1.3]))
def test_the_heaviest_wall_takes_in_those_around_it(segments: AlignedSegments, distance: float) -> None:
    walls = find_walls(segments, 0.1)
    leader: dict[int, int] = {}
    for wall in sorted(range(len(walls)), key=lambda w: (-round(float(walls.length[w]), 9), w)):
        if wall not in leader:
            for other in range(len(walls)):
                same = walls.direction[other] == walls.direction[wall]
                if same and other not in leader and abs(walls.offset[other] - walls.offset[wall]) < distance:
                    leader[other] = wall
    rank = {w: k for k, w in enumerate(sorted(set(leader.values())))}
    assert merge_walls(segments, walls, distance).group.tolist() == [
        rank[leader[w]] for w in walls.group.tolist()
    ]


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 20), st.integers(0, 10**6))
def test_half_of_the_weight_lies_at_or_below_the_median(n: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    values, weights = rng.integers(0, 9, n).astype(float), rng.integers(1, 5, n).astype(float)
    group = np.concatenate(([0, 1, 2], rng.integers(0, 3, n)))[:n]
    count = int(group.max()) + 1
    for k, median in enumerate(grouped_median(values, weights, group, count).tolist()):
        inside = group == k
        below = [weights[inside & (values <= v)].sum() for v in sorted(values[inside])]
        first = next(i for i, b in enumerate(below) if b >= weights[inside].sum() / 2)
        assert median == sorted(values[inside])[first]


@settings(max_examples=60, deadline=None)
@given(maps)
def test_surfaces_are_occupied_cells_beside_free_ones(cells: np.ndarray) -> None:
    padded = np.pad(cells, 1, constant_values=-1)
    found = surfaces(cells)
    for r, c in np.ndindex(cells.shape):
        assert found[r, c] == (cells[r, c] == 100 and bool((padded[r : r + 3, c : c + 3] == 0).any()))


@settings(max_examples=40, deadline=None)
@given(maps, st.booleans(), st.booleans(), st.booleans())
def test_what_is_laid_down_is_lifted_as_it_was(cells: np.ndarray, rows: bool, cols: bool, swap: bool) -> None:
    posture = Posture(mirror_rows=rows, mirror_cols=cols, swap=swap)
    laid = cells[:: -1 if rows else 1, :: -1 if cols else 1]
    assert (posture.lay(cells) == (laid.T if swap else laid)).all()
    assert (posture.lift(posture.lay(cells)) == cells).all()
    assert (posture.lift(posture.lay(cells == 0)) == (cells == 0)).all()


@settings(max_examples=60, deadline=None)
@given(maps, st.integers(1, 3), st.integers(0, 10**6))
def test_labels_spread_into_walls_step_by_step(cells: np.ndarray, steps: int, seed: int) -> None:
    wall = cells == 100
    labels = np.where(cells == 0, np.random.default_rng(seed).integers(1, 4, cells.shape), 0).astype(np.int32)
    found = labels.copy()
    spread_in_place(found, wall, steps)
    assert (found[~wall] == labels[~wall]).all()
    reached = labels > 0
    for _ in range(steps):
        padded = np.pad(reached, 1)
        beside = padded[:-2, 1:-1] | padded[2:, 1:-1] | padded[1:-1, :-2] | padded[1:-1, 2:]
        reached = reached | (wall & beside)
    assert ((found > 0) == reached).all()
    grown = np.pad(found, 1)
    for r, c in np.argwhere(wall & (found > 0)):
        around = (grown[r, c + 1], grown[r + 2, c + 1], grown[r + 1, c], grown[r + 1, c + 2])
        assert found[r, c] in around


def slow_gaps(blocked: np.ndarray, sizes: tuple[int, ...]) -> set[tuple[int, int, int, int, int]]:
    """Row, first column, width, longer and shorter wall of each gap along the rows."""
    narrowest, widest, run_min, widening, reach, longest, slack = sizes
    found, runs = set(), free_runs(blocked)
    for r in range(1, len(blocked) - 1):
        walls = np.flatnonzero(blocked[r])
        for left, right in zip(walls[:-1].tolist(), walls[1:].tolist(), strict=True):
            n = right - left - 1
            if not narrowest <= n <= widest:
                continue
            middle = left + 1 + n // 2
            wide = []
            for step in (-1, 1):
                column = runs[
                    r + step : r + step * (reach + 1) if r + step * (reach + 1) >= 0 else None : step, middle
                ]
                shut = np.flatnonzero(column == 0)
                wide.append(bool((column[: shut[0] if len(shut) else None] >= n + widening).any()))
            thick = blocked[max(r - slack, 0) : r + slack + 1].any(axis=0)
            ends = [np.flatnonzero(~t) for t in (thick[left::-1], thick[right:])]
            one, other = (
                min(int(e[0]) if len(e) else len(t), longest)
                for e, t in zip(ends, (thick[left::-1], thick[right:]), strict=True)
            )
            if all(wide) and max(one, other) >= run_min:
                found.add((r, left + 1, n, max(one, other), min(one, other)))
    return found


@settings(max_examples=60, deadline=None)
@given(
    hnp.arrays(
        np.bool_,
        st.tuples(st.integers(1, 14), st.integers(1, 16)),
        elements=st.sampled_from([True, False, False]),
    )
)
def test_openings_are_the_gaps_along_rows_and_columns(blocked: np.ndarray) -> None:
    config = OpeningConfig(door_min=1.0, door_max=4.0, door_run=1.0, widening=1.0, reach=2.0, slack=1.0)
    sizes = (1, 4, 1, 1, 2, 5, 1)
    narrowest = np.full(blocked.shape, 99)
    for mask, gaps in ((blocked, narrowest), (blocked.T, narrowest.T)):
        for r, c, n, _, _ in slow_gaps(mask, sizes):
            gaps[r, c : c + n] = np.minimum(gaps[r, c : c + n], n)
    found = find_openings(blocked, 1.0, config)
    assert ((found.gap > 0) == (narrowest < 99)).all()
    assert (found.table[found.gap, WIDTH][found.gap > 0] == narrowest[found.gap > 0]).all()
    expected = [gap[2:] for mask in (blocked, blocked.T) for gap in slow_gaps(mask, sizes)]
    assert sorted(map(tuple, found.table[1:, [WIDTH, LONG, SHORT]].tolist())) == sorted(expected)


def test_the_judge_walks_every_tree_to_its_leaf() -> None:
    forest = load_forest()
    x = np.random.default_rng(0).normal(size=(7, FEATURE_COUNT))
    found = np.empty(7)
    log_odds(x, forest.numbers, found)
    for sample, odds in zip(x, found, strict=True):
        total = forest.bias
        for root in forest.roots:
            i = int(root)
            while forest.feature[i] >= 0:
                i = int(
                    (forest.left if sample[forest.feature[i]] <= forest.threshold[i] else forest.right)[i]
                )
            total += forest.threshold[i]
        assert odds == total


@settings(max_examples=80, deadline=None)
@given(hnp.arrays(np.bool_, st.tuples(st.integers(1, 5), st.integers(1, 40))))
def test_true_cells_are_where_the_mask_is_true(mask: np.ndarray) -> None:
    for part in (mask, mask[:, ::2]):
        assert true_cells(part).tolist() == np.flatnonzero(part).tolist()


@settings(max_examples=100, deadline=None)
@given(st.lists(st.integers(0, 5), min_size=2, max_size=24), st.sampled_from([0.1, 0.3, 0.5]))
def test_peaks_of_a_circular_profile(values: list[int], least: float) -> None:
    profile = np.array(values) / 5
    n = len(values)
    slow, found = find_peaks(np.tile(profile, 3), prominence=least)
    middle = (slow >= n) & (slow < 2 * n)
    peaks, prominences = _circular_peaks(profile, least)
    assert peaks.tolist() == (slow[middle] - n).tolist()
    assert prominences.tolist() == found["prominences"][middle].tolist()
