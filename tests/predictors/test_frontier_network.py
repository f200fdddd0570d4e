"""The network that judges frontiers: its windows against slow ones, its whole numbers against torch, its memory, its training."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError
from layoutexplore.frontiers.detection import FrontierClusters, find_frontiers
from layoutexplore.models.network_files import load_weights, save_weights
from layoutexplore.predictors.bit_map import ALONG_COLS, ALONG_ROWS, DOOR_BIT, FREE_BIT, UNKNOWN_BIT, WALL_BIT
from layoutexplore.predictors.frontier_model.features import Surroundings, look_around
from layoutexplore.predictors.frontier_model.network import LAYERS, MOST, SHAPES, FrontierNetwork
from layoutexplore.predictors.frontier_model.network_input import (
    BEHIND,
    DOORWAY,
    KNOWN,
    OTHER_ROOM,
    PLANES,
    ROOM_BEHIND,
    SIDE,
    SOLID,
    SQUARE,
    draw_truth,
    draw_windows,
)
from layoutexplore.predictors.seen_rooms import seen_regions

GRIDS = hnp.arrays(
    np.int8,
    st.tuples(st.integers(6, 40), st.integers(6, 40)),
    elements=st.sampled_from([-1, -1, 0, 0, 0, 100]),
)


def around_of(cells: NDArray[np.int8], clusters: FrontierClusters, resolution: float = 0.1) -> Surroundings:
    return look_around(cells, clusters, seen_regions(cells, resolution), resolution)


def slow_window(around: Surroundings, k: int) -> NDArray[np.float64]:
    """Shares 0..1 of the window of a frontier, cell by cell."""
    chart, labels, resolution = (
        around.chart,
        np.pad(around.regions.labels, around.chart.margin),
        around.resolution,
    )
    row, col, *axes = around.frames[k, :6].tolist()
    forward, sideways = np.array(axes[:2]), np.array(axes[2:])
    across, along = (ALONG_COLS, ALONG_ROWS) if forward[0] == 0 else (ALONG_ROWS, ALONG_COLS)
    bits = (FREE_BIT, WALL_BIT, UNKNOWN_BIT, DOOR_BIT, across, along)
    members = {tuple(cell) for cell in (around.frontiers.cells + chart.margin).tolist()}
    mine = {tuple(cell) for cell in (around.frontiers.cluster(k) + chart.margin).tolist()}
    sums, cells = np.zeros((SIDE, SIDE, PLANES)), np.zeros((SIDE, SIDE, 1))
    reach = int(SIDE * SQUARE / resolution)
    for i in range(-reach, reach):
        for j in range(-reach, reach):
            a = int(np.floor(i * resolution / SQUARE + 0.5 + 1e-9)) + BEHIND
            s = int(np.floor(j * resolution / SQUARE + 0.5 + 1e-9)) + SIDE // 2
            if not (0 <= a < SIDE and 0 <= s < SIDE):
                continue
            r, c = (np.array([row, col]) + i * forward + j * sideways).astype(int).tolist()
            inside = 0 <= r < chart.code.shape[0] and 0 <= c < chart.code.shape[1]
            code, label = (int(chart.code[r, c]), int(labels[r, c])) if inside else (UNKNOWN_BIT, 0)
            regions = [label > 0 and label == around.homes[k], label > 0 and label != around.homes[k]]
            sums[a, s, :8] += [*(code & bit > 0 for bit in bits), *regions]
            sums[a, s, 8] = max(sums[a, s, 8], (r, c) in mine)
            sums[a, s, 9] = max(sums[a, s, 9], (r, c) in members)
            cells[a, s] += 1
    sums[..., :8] /= cells
    return sums


@settings(max_examples=12, deadline=None)
@given(cells=GRIDS, resolution=st.sampled_from([0.05, 0.1, 0.15, 0.3]))
def test_windows_against_slow_ones(cells: NDArray[np.int8], resolution: float) -> None:
    clusters = find_frontiers(cells)
    if len(clusters) == 0:
        return
    around = around_of(cells, clusters, resolution)
    windows, last = draw_windows(around), len(clusters) - 1
    np.testing.assert_allclose(windows[last] / 255, slow_window(around, last), atol=0.51 / 255)
    np.testing.assert_array_equal(draw_windows(around, np.array([last, 0])), windows[[last, 0]])


@settings(max_examples=5, deadline=None)
@given(cells=GRIDS)
def test_squares_finer_and_coarser_than_cells(cells: NDArray[np.int8]) -> None:
    """A square of half a cell shows the cell; one of 37 x 37 cells, by some of them."""
    clusters = find_frontiers(cells)
    if len(clusters) == 0:
        return
    coarse = draw_windows(around_of(cells, clusters, 0.6))
    assert set(np.unique(coarse[..., :3]).tolist()) <= {0, 255}
    assert (coarse[..., :3].astype(int).sum(axis=3) == 255).all(), "free, occupied or unknown"
    fine = draw_windows(around_of(cells, clusters, 0.008))
    assert (np.abs(fine[..., :3].astype(int).sum(axis=3) - 255) <= 1).all()


@settings(max_examples=30, deadline=None)
@given(cells=GRIDS, where=st.tuples(st.integers(0, 3), st.integers(0, 3)))
def test_windows_do_not_tell_where_the_grid_ends(cells: NDArray[np.int8], where: tuple[int, int]) -> None:
    clusters = find_frontiers(cells)
    if len(clusters) == 0:
        return
    larger = np.full((cells.shape[0] + 5, cells.shape[1] + 7), -1, np.int8)
    larger[where[0] : where[0] + cells.shape[0], where[1] : where[1] + cells.shape[1]] = cells
    moved = FrontierClusters(clusters.cells + np.array(where, np.int32), clusters.offsets)
    np.testing.assert_array_equal(
        draw_windows(around_of(larger, moved)), draw_windows(around_of(cells, clusters))
    )


def test_mirrored_and_turned_frontiers_have_one_window() -> None:
    cells = np.full((61, 61), -1, np.int8)
    cells[10:40, 10:40] = 100
    cells[12:38, 12:38] = 0
    cells[20:29, 38:40] = 0
    cells[15:20, 40] = -1
    windows = []
    for turns in range(4):
        for mirrored in (False, True):
            seen = np.ascontiguousarray(np.rot90(cells[:, ::-1] if mirrored else cells, turns))
            windows.append(
                draw_windows(around_of(seen, FrontierClusters.of([find_frontiers(seen).cluster(0)])))[0]
            )
    for window in windows:
        # The middle of the frontier has one more square to one side than to the other.
        assert any(np.array_equal(window[:, 1:], way) for way in (windows[0][:, 1:], windows[0][:, :0:-1]))
    assert windows[0][: BEHIND - 2, ..., 0].sum() > windows[0][BEHIND + 2 :, ..., 0].sum() == 0, (
        "ahead nothing is known"
    )


@settings(max_examples=25, deadline=None)
@given(cells=GRIDS, rooms=st.integers(1, 3), seed=st.integers(0, 99))
def test_truth_of_squares(cells: NDArray[np.int8], rooms: int, seed: int) -> None:
    """With squares of three cells, each is what the cell in its middle is."""
    clusters = find_frontiers(cells)
    if len(clusters) == 0:
        return
    rng = np.random.default_rng(seed)
    around, free = around_of(cells, clusters), rng.random(cells.shape) < 0.7
    room_ids = rng.integers(0, rooms + 1, cells.shape, np.int32)
    behind = rng.integers(0, rooms + 1, len(clusters), np.int32)
    drawn = draw_truth(around, behind, room_ids, free)
    for k in range(len(clusters)):
        row, col, *axes = (around.frames[k, :6] - ([around.chart.margin] * 2 + [0] * 4)).astype(int).tolist()
        for a in range(SIDE):
            for s in range(SIDE):
                i, j = 3 * (a - BEHIND), 3 * (s - SIDE // 2)
                r, c = row + i * axes[0] + j * axes[2], col + i * axes[1] + j * axes[3]
                if not (0 <= r < cells.shape[0] and 0 <= c < cells.shape[1]):
                    expected = SOLID
                elif cells[r, c] >= 0:
                    expected = KNOWN
                elif not free[r, c]:
                    expected = SOLID
                elif room_ids[r, c] == 0:
                    expected = DOORWAY
                else:
                    expected = ROOM_BEHIND if room_ids[r, c] == behind[k] else OTHER_ROOM
                assert drawn[k, a, s] == expected, (k, a, s)


def random_weights(seed: int) -> dict[str, NDArray[np.generic]]:
    """Whole weights that neither fade nor saturate."""
    rng, weights = np.random.default_rng(seed), dict[str, NDArray[np.generic]]()
    for name, (inputs, outputs, side, _) in LAYERS.items():
        size = side * side * inputs
        weights[f"{name}.weight"] = rng.integers(-MOST, MOST + 1, (size, outputs)).astype(np.int8)
        weights[f"{name}.scale"] = np.full(outputs, 2.0 / (MOST * np.sqrt(size)), np.float32)
        weights[f"{name}.bias"] = rng.normal(0, 5, outputs).astype(np.float32)
    return weights


def random_windows(count: int, seed: int = 0) -> NDArray[np.uint8]:
    return np.random.default_rng(seed).integers(0, 256, (count, SIDE, SIDE, PLANES)).astype(np.uint8)


def network_of(weights: Mapping[str, NDArray[np.generic]]) -> FrontierNetwork:
    return FrontierNetwork({name: values.astype(np.float32) for name, values in weights.items()})


def test_sums_are_exact() -> None:
    """Largest inputs times largest weights stay below 2^24 in every layer, so that no order of summing matters."""
    for name, (inputs, _, side, _) in LAYERS.items():
        largest = 255 if name == next(iter(LAYERS)) else MOST
        assert side * side * inputs * largest * MOST < 2**24, name


def test_company_and_memory_change_nothing() -> None:
    network, windows = network_of(random_weights(0)), random_windows(9)
    alone = np.concatenate([network_of(random_weights(0)).judge(windows[k : k + 1]) for k in range(9)])
    assert len(np.unique(alone[:, 0])) == 9, "windows differ"
    np.testing.assert_array_equal(network.judge(windows[:5]), alone[:5])
    np.testing.assert_array_equal(network.judge(windows[[7, 3, 3, 1, 8]]), alone[[7, 3, 3, 1, 8]])
    np.testing.assert_array_equal(network.judge(windows[::-1]), alone[::-1])
    assert network.judge(windows[:0]).shape == (0, 3)


def slowly_judged(
    weights: Mapping[str, NDArray[np.generic]], window: NDArray[np.uint8]
) -> NDArray[np.float64]:
    """What the network finds for one window as it is, square by square; sums are exact in whole numbers."""
    values = window.astype(np.int64)
    for name, (inputs, outputs, side, stride) in LAYERS.items():
        kernel = weights[f"{name}.weight"].astype(np.int64)
        if side == 1:
            sums = values.reshape(-1) @ kernel
        else:
            rows, cols = (-(-size // stride) for size in values.shape[:2])
            padded, sums = np.pad(values, ((1, 1), (1, 1), (0, 0))), np.zeros((rows, cols, outputs), np.int64)
            kernel = kernel.reshape(side, side, inputs, outputs)
            for r in range(rows):
                for c in range(cols):
                    shown = padded[r * stride : r * stride + side, c * stride : c * stride + side]
                    sums[r, c] = np.tensordot(shown, kernel, axes=3)
        found = sums.astype(np.float32) * weights[f"{name}.scale"] + weights[f"{name}.bias"]
        values = np.clip(np.rint(found), 0, MOST).astype(np.int64)
    return np.asarray(found, np.float64)


@pytest.mark.parametrize("seed", range(4))
def test_judgement_against_a_slow_one(seed: int) -> None:
    """The mean over the window and the mirrored one, to the last bit."""
    weights, windows = random_weights(seed), random_windows(2, seed)
    windows[1] *= np.random.default_rng(seed).random((SIDE, SIDE, 1)) < 0.3
    expected = [
        (slowly_judged(weights, window) + slowly_judged(weights, window[:, ::-1])) / 2 for window in windows
    ]
    np.testing.assert_array_equal(network_of(weights).judge(windows), np.array(expected, np.float32))


def test_mirrored_windows_are_judged_alike() -> None:
    windows = random_windows(4)
    np.testing.assert_array_equal(
        network_of(random_weights(2)).judge(windows), network_of(random_weights(2)).judge(windows[:, :, ::-1])
    )


def test_a_network_survives_its_file(tmp_path: Path) -> None:
    weights, windows, path = random_weights(1), random_windows(3), tmp_path / "frontiers.safetensors"
    save_weights(path, weights, "a test")
    read = FrontierNetwork(load_weights(path, SHAPES))
    np.testing.assert_array_equal(read.judge(windows), network_of(weights).judge(windows))
    save_weights(path, {name: values for name, values in weights.items() if name != "weigh.scale"}, "a test")
    with pytest.raises(ConfigError, match=r"frontiers\.safetensors: weigh\.scale is missing"):
        load_weights(path, SHAPES)


def test_rounding_keeps_what_torch_has_learnt() -> None:
    torch = pytest.importorskip("torch")
    from layoutexplore.training.frontier_network import TrainableFrontierNetwork, rounded

    torch.manual_seed(0)
    network, windows = TrainableFrontierNetwork(0.0), wide_and_narrow()[0]
    shares = torch.from_numpy(windows).permute(0, 3, 1, 2).float() / 255.0
    with torch.no_grad():
        for _ in range(40):
            network.train()(shares)  # The norms get to know the windows.
        expected = ((network.eval()(shares) + network(shares.flip(3))) / 2).numpy()
    weights = rounded(network, windows)
    found = network_of(weights).judge(windows)
    for output in range(3):
        assert np.corrcoef(found[:, output], expected[:, output])[0, 1] > 0.97
    np.testing.assert_allclose(found.mean(axis=0), expected.mean(axis=0), atol=0.02)


def wide_and_narrow() -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """Windows with much or little that is unknown ahead, and which these are."""
    rng = np.random.default_rng(0)
    windows, narrow = np.zeros((300, SIDE, SIDE, PLANES), np.uint8), rng.random(300) < 0.5
    for window, is_narrow in zip(windows, narrow, strict=True):
        depth, width = rng.integers(4, 20), 4 if is_narrow else 14
        window[BEHIND : BEHIND + depth, SIDE // 2 - width : SIDE // 2 + width, 2] = 255
    return windows, narrow


def test_training_tells_wide_from_narrow() -> None:
    pytest.importorskip("torch")
    from layoutexplore.training.frontier_network import FrontierNetworkConfig, trained_frontier_network
    from layoutexplore.training.predictor_samples import WindowSamples

    windows, closed = wide_and_narrow()
    area = np.where(closed, 0.5, 20.0)
    truth = np.where(
        windows[..., 2] > 0, np.where(closed[:, None, None], ROOM_BEHIND, OTHER_ROOM), KNOWN
    ).astype(np.uint8)
    parts = [
        WindowSamples(windows[k::2], closed[k::2], area[k::2], truth[k::2], name)
        for k, name in enumerate("ab")
    ]
    told: list[tuple[int, int, float]] = []
    config = FrontierNetworkConfig(steps=60, batch=32)
    weights = trained_frontier_network(
        parts[:1], parts[1:], {"b": "house"}, config, lambda *args: told.append(args)
    )
    found = network_of(weights).judge(windows)
    assert (((found[:, 0] > 0) == closed).mean(), ((found[:, 1] > 0) == closed).mean()) > (0.95, 0.95)
    assert found[closed, 2].max() < found[~closed, 2].min()
    assert told[-1][:2] == (60, 60) and told[-1][2] < told[0][2]
    again = trained_frontier_network(parts[:1], parts[1:], {"b": "house"}, config, lambda *_: None)
    assert all(np.array_equal(weights[name], again[name]) for name in SHAPES), (
        "the same seed, the same network"
    )
    assert all(weights[name].shape == shape for name, shape in SHAPES.items())


def test_squares_are_drawn_the_way_their_windows_lie() -> None:
    """What is ahead to the left is the room behind, to the right another: only a window that lies as its truth does tells."""
    torch = pytest.importorskip("torch")
    from layoutexplore.training.frontier_network import (
        FrontierNetworkConfig,
        TrainableFrontierNetwork,
        _Draws,
        _Pool,
        _train,
    )
    from layoutexplore.training.predictor_samples import WindowSamples

    rng = np.random.default_rng(0)
    windows = np.zeros((64, SIDE, SIDE, PLANES), np.uint8)
    windows[:, :, : SIDE // 2, 6] = 255
    windows[:, : BEHIND // 2, :, 1] = 255
    windows[..., 0] = rng.integers(0, 2, windows.shape[:3]) * 255
    truth = np.where(
        windows[..., 1] > 0, KNOWN, np.where(windows[..., 6] > 0, ROOM_BEHIND, OTHER_ROOM)
    ).astype(np.uint8)
    pool = _Pool([WindowSamples(windows, np.ones(64, np.bool_), np.ones(64), truth, "a")], {})
    config = FrontierNetworkConfig(steps=40, batch=16, rate=1e-2)
    draws, ways = _Draws(pool, _Pool([], {}), config), set()
    for _ in range(20):
        drawn, _, _, of = draws.draw(3)
        expected = np.where(drawn[..., 1] > 0, KNOWN, np.where(drawn[..., 6] > 0, ROOM_BEHIND, OTHER_ROOM))
        np.testing.assert_array_equal(of, expected)
        ways.add(bool(drawn[0, 0, 0, 6]))
    assert ways == {False, True}, "some are mirrored"
    torch.manual_seed(0)
    network = TrainableFrontierNetwork(0.0)
    _train(network, draws, config, lambda *_: None)
    with torch.no_grad():
        squares = network.drawing(
            network.hidden(torch.from_numpy(windows).permute(0, 3, 1, 2).float() / 255.0)
        ).argmax(1)
    riddles = truth != KNOWN
    assert (squares.numpy()[riddles] == truth[riddles]).mean() > 0.95
