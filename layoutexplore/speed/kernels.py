"""Speed of ray casting, mapping, frontiers and planning, each beside the quickest way of a common library."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from typing import Any

import cv2
import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from layoutexplore.frontiers.detection import FrontierDetector, find_frontiers
from layoutexplore.grids.arrays import Ints, Ints32, Mask
from layoutexplore.grids.components import label_components
from layoutexplore.grids.grid import Cell, Pose
from layoutexplore.grids.morphology import inflate
from layoutexplore.planning.shortest_paths import distance_matrix, geodesic_distances
from layoutexplore.sensing.lidar import Lidar
from layoutexplore.sensing.mapper import Mapper
from layoutexplore.sensing.scan_matching import ScanMatcher
from layoutexplore.speed.floors import RESOLUTION, floor, half_explored, lidar, poses
from layoutexplore.speed.measurement import SpeedRow, milliseconds

_RAYS_PER_SECOND = 10e6
_RAYS_RATIO = 5.0


def ray_casting() -> Iterator[SpeedRow]:
    """Exact ranges against a polar image of the map by cv2.remap, sampled at half cells (not exact)."""
    yield _ray_casting(360, 100)
    yield _ray_casting(720, 200)


def _ray_casting(beams: int, reach: int) -> SpeedRow:
    occupied = floor(700, 700)
    places = poses(occupied, 100)
    sensor = lidar(occupied, beams, reach)
    image = occupied.astype(np.uint8)
    distance = np.arange(0.0, reach, 0.5, dtype=np.float32)
    angles = np.linspace(-math.pi, math.pi, beams, endpoint=False, dtype=np.float32)[:, None]
    across, up = distance * np.cos(angles), distance * np.sin(angles)

    def polar(pose: Pose) -> object:
        x, y = np.float32(pose.x / RESOLUTION - 0.5), np.float32(pose.y / RESOLUTION - 0.5)
        seen = cv2.remap(image, across + x, up + y, cv2.INTER_NEAREST, borderValue=(1,))
        return np.argmax(seen, axis=1)

    few = places[:20]
    ours, reference = milliseconds(
        lambda: [sensor.scan(p) for p in places], lambda: [polar(p) for p in few], repeats=9
    )
    rays = beams * len(places) / ours * 1e3
    others = beams * len(few) / reference * 1e3
    return SpeedRow(
        name=f"rays, {beams} x {reach} cells",
        ours=rays / 1e6,
        unit="M/s",
        reference=others / 1e6,
        reference_name="polar cv2.remap",
        goal=f">= {_RAYS_PER_SECOND / 1e6:.0f} M/s or {_RAYS_RATIO:.0f}x",
        reached=max(rays / _RAYS_PER_SECOND, rays / others / _RAYS_RATIO),
    )


def mapping() -> Iterator[SpeedRow]:
    """Scan and map update (720 beams, 80 cells) from an unknown map on; then in a map ten times as large."""
    small = floor(480, 640)
    large = np.ones((1500, 2000), np.bool_)
    large[: small.shape[0], : small.shape[1]] = small
    places = poses(small, 100)

    def explorer(occupied: Mask) -> Callable[[], None]:
        sensor = lidar(occupied, 720, 80)
        mapper = Mapper(occupied.shape, RESOLUTION, Pose(0.0, 0.0))
        seen = mapper.grid.cells[: small.shape[0], : small.shape[1]]

        def explore() -> None:
            seen[:] = -1
            for pose in places:
                mapper.observe(sensor, pose)

        return explore

    in_small, in_large = (
        len(places) / ms * 1e3 for ms in milliseconds(explorer(small), explorer(large), repeats=15)
    )
    yield _rate("scan + map, 480 x 640", in_small, 15_000)
    yield SpeedRow(
        name="scan + map, 1500 x 2000",
        ours=in_large,
        unit="scans/s",
        reference=in_small,
        reference_name="in 480 x 640",
        goal=">= 0.9x, any map size",
        reached=in_large / in_small / 0.9,
    )


def noisy_mapping() -> Iterator[SpeedRow]:
    """Log-odds updates by noisy ranges (720 beams, 80 cells), and the same with each scan matched first."""
    occupied = floor(480, 640)
    config = dataclasses.replace(lidar(occupied, 720, 80).config, range_noise_std=0.03, dropout=0.01)
    sensor, rng = Lidar(config, occupied, RESOLUTION, Pose(0.0, 0.0)), np.random.default_rng(0)
    places = poses(occupied, 100)
    scans = [(pose, sensor.scan(pose, rng)) for pose in places]
    mapper, matched = (Mapper(occupied.shape, RESOLUTION, Pose(0.0, 0.0)) for _ in range(2))
    matcher = ScanMatcher(matched.grid)

    def integrate() -> None:
        for pose, ranges in scans:
            mapper.integrate(pose, ranges, config)

    def match() -> None:
        for believed, ranges in scans:
            pose = matcher.match(believed, ranges, config, position_std=0.03, heading_std=0.01)
            matched.integrate(pose, ranges, config)
            matcher.add(pose, ranges, config)

    alone, corrected = (len(scans) / ms * 1e3 for ms in milliseconds(integrate, match, repeats=9))
    yield _rate("log odds, 480 x 640", alone, 10_000)
    matching = _rate("scan matching + log odds", corrected, 500)
    yield dataclasses.replace(matching, reference=alone, reference_name="without matching")


def _rate(name: str, ours: float, least: int) -> SpeedRow:
    """Scans a second, of which at least so many are to be reached."""
    goal = f">= {least:_} scans/s".replace("_", " ")
    return SpeedRow(name=name, ours=ours, unit="scans/s", goal=goal, reached=ours / least)


def _beside(
    name: str, ours: float, reference: float, reference_name: str, times: float, same: bool | None = None
) -> SpeedRow:
    """Milliseconds beside a reference's: it is to take so many times as long, and to find the same."""
    return SpeedRow(
        name=name,
        ours=ours,
        unit="ms",
        reference=reference,
        reference_name=reference_name,
        goal=f">= {times:g}x" + (", same values" if same is not None else ""),
        reached=reference / ours / times if same is not False else 0.0,
    )


def frontiers() -> Iterator[SpeedRow]:
    """All frontiers of a half explored map, and after changes in a box; beside cv2's connected components."""
    cells = half_explored(700, 700)
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    detector = FrontierDetector(cells.shape)
    detector.update(cells, (0, 700, 0, 700))

    def reference() -> object:
        beside = cv2.dilate((cells == -1).view(np.uint8), cross)
        return cv2.connectedComponentsWithStats(beside & (cells == 0).view(np.uint8), connectivity=8)

    full, updated, other = milliseconds(
        lambda: find_frontiers(cells),
        lambda: detector.update(cells, (250, 450, 250, 450)),
        reference,
        repeats=15,
        inner=3,
    )
    yield _beside("frontiers, 700 x 700", full, other, "cv2 components", 5.0)
    yield _beside("frontiers, 200 x 200 new", updated, full, "all anew", 2.0)


def parts() -> Iterator[SpeedRow]:
    """The connected parts of what is half a metre from walls, beside cv2.connectedComponents."""
    mask = ~inflate(floor(700, 700), 0.5, RESOLUTION)

    def reference() -> Ints32:
        return np.asarray(
            cv2.connectedComponents(mask.view(np.uint8), connectivity=4, ltype=cv2.CV_32S)[1], np.int32
        )

    ours, other = milliseconds(lambda: label_components(mask), reference, repeats=15, inner=3)
    same = np.array_equal(label_components(mask)[0], reference())
    yield _beside("connected parts, 700 x 700", ours, other, "cv2 components", 2.0, same)


def geodesics() -> Iterator[SpeedRow]:
    """Distances to all cells and between 40 places, beside scipy's search on a graph built beforehand."""
    traversable = ~inflate(floor(700, 700), 0.2, RESOLUTION)
    start = poses(floor(700, 700), 1)[0]
    source = Cell(int(start.y / RESOLUTION), int(start.x / RESOLUTION))
    graph, index = _graph(traversable)
    node = np.array(index[source])
    ours, reference = milliseconds(
        lambda: geodesic_distances(traversable, source, RESOLUTION),
        lambda: dijkstra(graph, indices=node),
        repeats=5,
    )
    same = np.allclose(
        geodesic_distances(traversable, source, 1.0)[traversable], dijkstra(graph, indices=node), rtol=1e-6
    )
    yield _beside("geodesics, 700 x 700", ours, reference, "csgraph.dijkstra", 8.0, same)
    reached = np.argwhere(np.isfinite(geodesic_distances(traversable, source, RESOLUTION)))
    places = reached[np.random.default_rng(0).integers(len(reached), size=40)].astype(np.int32)
    (matrix,) = milliseconds(lambda: distance_matrix(traversable, places, RESOLUTION), repeats=5)
    yield SpeedRow(
        name="geodesics, 40 x 40",
        ours=matrix,
        unit="ms",
        reference=40 * reference,
        reference_name="40 x csgraph",
    )


def _graph(traversable: Mask) -> tuple[Any, Ints]:
    """The octile graph without corner cutting of the traversable cells, and the node (rows, cols) of each."""
    index = np.cumsum(traversable.ravel()).reshape(traversable.shape) - 1
    rows, cols = traversable.shape
    starts, ends, lengths = [], [], []
    for dr, dc in ((0, 1), (1, 0), (1, 1), (1, -1)):
        here = slice(0, rows - dr), slice(max(0, -dc), cols - max(0, dc))
        there = slice(dr, rows), slice(max(0, dc), cols + min(0, dc))
        both = traversable[here] & traversable[there]
        if dr and dc:
            both &= traversable[here[0], there[1]] & traversable[there[0], here[1]]
        starts.append(index[here][both])
        ends.append(index[there][both])
        lengths.append(np.full(int(both.sum()), math.hypot(dr, dc)))
    a, b, w = np.concatenate(starts), np.concatenate(ends), np.concatenate(lengths)
    count = int(traversable.sum())
    graph = csr_array((np.tile(w, 2), (np.concatenate([a, b]), np.concatenate([b, a]))), shape=(count, count))
    return graph, index
