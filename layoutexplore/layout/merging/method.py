"""The method `default`: regions of the free space, merged into rooms by a learned classifier.

1. The map is brought into its canonical one of eight orientations and turned to its main direction (ROSE's
   profile of the walls' surfaces).
2. Short gaps in line with walls, in any of their directions, are door-gap candidates. With them shut,
   connected components that float freely and are small are clutter; the rest is wall.
3. The distance to walls, shut gaps and unseen space falls into watershed basins: more regions than there are
   rooms.
4. Slivers join the neighbour they open to most widely. Representative lines through the long walls cut the
   map into faces and rooms of their own (the idea of ROSE2), which fall apart where the passes inside them
   are narrow; they are no result but evidence.
5. What beams have painted outside the building, through doors, windows and glass, is told by a forest that
   looks at each region (the unknown and the walls on its border, the walls around it, ...), and left out.
6. Small forests of decision trees look at two touching regions (the pass between them, the door gaps and
   walls in line with it, the lines between them, their shapes and that of their union, ...), and the surest
   pair merges, again and again, while it is likely that both belong to one room. Regions too small for a
   room then join the neighbour they most likely belong to, and so do nooks that are not surely rooms.
7. Merging goes on while it is at all possible that a pair is one room. Another forest looks at each merge on
   the way with what came of it (the whole region, its borders, what it would merge with next, ...). By both
   forests, the likeliest set of merges stands in which none stands without all that it is made of.
8. What is too small for a room is dropped. The rooms' cells are turned back.

What varies from map to map is in the features; there is one set of parameters. Where a wing stands askew, the
forests are others, which have learnt from such buildings too. So they are where walls are ragged as on
recorded maps: there a small network is asked where the borders of rooms run and which places share a room,
and half of each forest has learnt what that is worth.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numba import njit

from layoutexplore.errors import ConfigError
from layoutexplore.grids.arrays import Cells, Floats, Ints, Ints32, Mask
from layoutexplore.grids.bitsets import true_cells
from layoutexplore.grids.flood import grow_in_place, spread_in_place
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from layoutexplore.grids.runs import find_runs
from layoutexplore.layout.alignment import Turned, surfaces, turn_back
from layoutexplore.layout.canonical import with_unknown_around
from layoutexplore.layout.frame import angles_to_world, to_world
from layoutexplore.layout.limits import cells_at_most, left_out, most_lines, most_questions, most_regions
from layoutexplore.layout.lines.assemble import freed, place_walls
from layoutexplore.layout.lines.declutter import Directions
from layoutexplore.layout.lines.face_model import WallModel
from layoutexplore.layout.lines.rose2 import Rose2Config, chain_walls, with_perpendicular
from layoutexplore.layout.lines.segments import find_segments
from layoutexplore.layout.merging.adjacency_graph import GraphEvidence, region_graph, rooms_of_regions
from layoutexplore.layout.merging.agglomeration import grow_tree, merge_within
from layoutexplore.layout.merging.chamfer import edge_distances
from layoutexplore.layout.merging.details import MergingDetails
from layoutexplore.layout.merging.graph_tables import RegionGraph
from layoutexplore.layout.merging.line_evidence import LineEvidence, find_evidence
from layoutexplore.layout.merging.line_rooms import split_line_rooms
from layoutexplore.layout.merging.merge_tree.contest import Rest
from layoutexplore.layout.merging.merge_tree.cut import MergingModels, best_cut, load_models, standing_odds
from layoutexplore.layout.merging.ray_fans.classifier import FAN_FOREST, outside_regions, without_regions
from layoutexplore.layout.merging.ray_fans.enclosure import enclosure_of_regions
from layoutexplore.layout.merging.ray_fans.features import describe_regions
from layoutexplore.layout.merging.separator.network import UNASKED, load_separator
from layoutexplore.layout.merging.slivers import absorb_slivers
from layoutexplore.layout.merging.walls.aligned_map import AlignedMapConfig, align_map
from layoutexplore.layout.merging.watershed import closed_space, watershed_basins
from layoutexplore.layout.outlines import rooms_of_labels
from layoutexplore.layout.pipeline import register_method
from layoutexplore.layout.timing import StageTimer
from layoutexplore.layout.types import Deferred, Layout, empty_layout, has_free_space
from layoutexplore.options import Rule, check

WALLS = Rose2Config(twice=False)
"""How walls, lines and faces are made; the rooms do not depend on them."""


@dataclass(frozen=True, kw_only=True)
class MergingConfig(AlignedMapConfig):
    """Options of the method, those of door gaps and clutter among them; lengths in metres.

    Attributes:
        chink: Unseen space between seen space narrower than twice this is taken as free.
        basin_share: Two basins are one where the pass between them is at least this share of the lower
            peak ...
        basin_wide: ... or so far from all obstacles.
        sliver_area: Smaller regions join the neighbour they open to most widely before any pair is
            classified [m2].
        room_pass: Regions are in one room of the lines as far as the passes between them are this share of
            the smaller peak.
        merge_level: Regions merge while the log-odds of belonging together are at least this ...
        tree_level: ... and, once what is too small has joined a neighbour, down to this: which merges stand
            is then told by what they make.
        pair_weight: What the log-odds of the pair weigh in that, where those of what they make weigh 1.
        fan_level: Regions lie outside the building from these log-odds on (none do from infinity on) ...
        fan_spread: ... and so do those with these log-odds that they are open to.
        room_area: Smallest room [m2]; what is smaller joins the neighbour it most likely belongs to.
        nook_area: What is smaller than this joins it too [m2] ...
        nook_level: ... unless the log-odds are below this.
        wall_half: A room's polygon reaches so far into its walls, to the middle of those between two rooms.
    """

    chink: float = 0.25
    basin_share: float = 0.85
    basin_wide: float = 1.5
    sliver_area: float = 0.5
    room_pass: float = 0.6
    merge_level: float = 0.25
    tree_level: float = -2.0
    pair_weight: float = 2.0
    fan_level: float = field(default=2.0, metadata={"rule": Rule(finite=False)})
    fan_spread: float = 0.0
    room_area: float = 1.5
    nook_area: float = 3.0
    nook_level: float = -1.0
    wall_half: float = 0.3

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("basin_share", "room_pass"):
            if not 0 < getattr(self, name) <= 1:
                raise ConfigError(f"{name} must lie in (0, 1], got {getattr(self, name)}")
        least = dict.fromkeys(("sliver_area", "pair_weight", "wall_half"), Rule(low=0.0))
        check(self, basin_wide=Rule(high=1e6), **least)
        positive = min(self.clutter_area, self.clutter_length, self.basin_wide)
        if positive <= 0 or min(self.chink, self.clutter_gap, self.room_area, self.nook_area) < 0:
            raise ConfigError(
                "lengths and areas must be above 0 (chink, clutter_gap, room_area and nook_area may be 0)"
            )


@dataclass(frozen=True, eq=False)
class Oversegmentation:
    """The regions of a map before they merge.

    Attributes:
        turned: The known part of the map, aligned with its walls.
        labels: int32 of the shape of `turned.cells`, the regions.
        clutter: bool, occupied cells that are no wall.
        graph: What the regions are like, slivers having joined their neighbours.
        part: int32 (k + 1,), the region of the graph that each labelled one is a part of, 0 for none.
        features: float64 (regions of the graph, `RegionFeatures`), what each one is like by itself.
        structure: The directions of its walls, in the frame of its known part (the profile in the frame it
            was brought into).
        askew: float64 (n,), directions of further walls where a wing stands askew, in the turned frame.
        ragged: Whether the walls are ragged, no wing stands askew, and the separator network has answered.
        doubts: What was left out, in words.
    """

    turned: Turned
    labels: Ints32
    clutter: Mask
    graph: RegionGraph
    part: Ints32
    features: Floats
    structure: Directions
    askew: Floats
    ragged: bool
    doubts: tuple[str, ...] = ()


def find_regions(
    cells: Cells, resolution: float, config: MergingConfig, timer: StageTimer, *, asked: bool = False
) -> Oversegmentation:
    """Cut the free space of a grid into regions, no region in two rooms.

    Args:
        cells: int8 (rows, cols), with at least one free cell.
        resolution: Metres a cell.
        config: The options.
        timer: Takes the times of the stages.
        asked: Whether the separator network is asked in any case, else only of maps with ragged walls.
    """
    aligned = align_map(cells, resolution, config, timer)
    turned, wall, clutter, gaps = aligned.turned, aligned.wall, aligned.clutter, aligned.gaps
    with timer("basins"):
        inside = ~wall & (closed_space(turned.cells, resolution, config.chink) | (turned.cells != UNKNOWN))
        shut = ~inside | aligned.shut
        labels = watershed_basins(shut, resolution, share=config.basin_share, wide=config.basin_wide)
        grow_in_place(labels, inside, shut & inside)
    with timer("separator"):
        ragged = aligned.ragged and not len(aligned.askew)
        network = load_separator() if asked or ragged else UNASKED
        separator = network.judge(turned.cells, wall, gaps.gap, resolution)
    with timer("graph"):
        lines, free = find_evidence(turned.cells, wall, resolution), turned.cells == FREE
        graph = region_graph(
            labels,
            free=free,
            clutter=clutter,
            wall=wall,
            distance=edge_distances(inside),
            gaps=gaps,
            evidence=GraphEvidence(lines, separator),
            resolution=resolution,
        )
        graph, part_of = absorb_slivers(graph, config.sliver_area)
        graph, doubts = _with_line_rooms(graph, part_of, labels, free, lines)
        if ragged and not separator.size:
            doubts += ("what the network says of borders was left out: the map is too large",)
        graph = split_line_rooms(graph, config.room_pass)
        enclosure = enclosure_of_regions(labels, free, part_of, wall, resolution)
        features = describe_regions(graph.nodes, enclosure, resolution)
    return Oversegmentation(
        turned,
        labels,
        clutter,
        graph,
        part_of,
        features,
        aligned.structure,
        aligned.askew,
        ragged and separator.size > 0,
        doubts,
    )


def _with_line_rooms(
    graph: RegionGraph, part: Ints32, labels: Ints32, free: Mask, lines: LineEvidence
) -> tuple[RegionGraph, tuple[str, ...]]:
    """The graph with the rooms of the lines, counted now where there were too many regions with the slivers.

    Of still more regions than can be compared room by room, they are left out, with a warning.
    """
    count, most = len(graph.nodes) - 1, most_regions(labels.shape)
    rooms = int(lines.room.max(initial=0))
    if count > most or (count + 1) * (rooms + 1) > most**2:
        doubt = f"what the wall lines say of the rooms was left out: the map has {count} regions"
        return replace(graph, rooms=np.zeros((count + 1, 1))), (doubt,)
    if rooms and graph.rooms.shape[1] == 1:
        table = rooms_of_regions(part[labels], free, lines, count, graph.resolution)
        table[0] = 0.0
        graph = replace(graph, rooms=table)
    return graph, ()


def merge_into_rooms(
    regions: Oversegmentation, grid: OccupancyGrid, config: MergingConfig, models: MergingModels
) -> tuple[Ints32, Ints32, bool]:
    """Room labels int32 of the cells that are not occupied, the rooms' footprints, and if all is merged.

    A footprint is a room with its furniture and half its walls.
    """
    models = models.askew if models.askew and len(regions.askew) else models
    models = models.ragged if models.ragged and regions.ragged else models
    rest = Rest(config.room_area, config.nook_area, config.nook_level, most_questions(grid.shape))
    levels = {"level": config.fan_level, "spread": config.fan_spread}
    outside = outside_regions(regions.graph, regions.features, FAN_FOREST.load(), **levels)
    graph = without_regions(regions.graph, outside)
    if models.cut is None:
        into, done = merge_within(graph, models.pairs, config.merge_level, rest)
    else:
        tree, features, done = grow_tree(graph, models.pairs, config.merge_level, rest, config.tree_level)
        wholes = models.cut.score(features)
        into = best_cut(tree, standing_odds(tree, wholes, config.merge_level, config.pair_weight))
    into = np.where(outside, 0, into).astype(np.int32)[regions.part]
    footprint = turn_back(regions.labels, regions.turned, grid.shape)
    if regions.turned.angle:
        grow_in_place(footprint, grid.free)
    # the kernel takes no array that may only be read
    cells = np.require(grid.cells, requirements=("C", "W"))
    labels = _number_large(footprint, into, cells, grid.resolution**2, config.room_area)
    spread_in_place(
        footprint,
        np.ascontiguousarray(grid.occupied),
        cells_at_most(config.wall_half, grid.resolution, 10**6),
    )
    return labels, footprint, done


@njit(cache=True, nogil=True)
def _meet_regions(runs: Ints32, regions: Ints32, cells: Cells, count: int) -> tuple[Ints32, Ints]:
    """The regions as their first cells come in raster order; and the free cells of each, int64 (count,)."""
    order = np.empty(count, np.int32)
    free = np.zeros(count, np.int64)
    met = np.zeros(count, np.bool_)
    n = 0
    for k in range(len(runs)):
        r, first, last = runs[k]
        region = regions[r, first]
        if not met[region]:
            met[region] = True
            order[n] = region
            n += 1
        here, found = cells[r, first:last], 0
        for c in range(here.size):
            found += here[c] == FREE
        free[region] += found
    return order[:n], free


@njit(cache=True, nogil=True)
def _number_large(regions: Ints32, into: Ints32, cells: Cells, cell_area: float, room_area: float) -> Ints32:
    """Turn regions into rooms in place, without the small ones, numbered in raster order.

    Returns the rooms without occupied cells.
    """
    runs = find_runs(regions, np.int32(0))
    order, free = _meet_regions(runs, regions, cells, len(into))
    known = np.zeros(len(into), np.int64)
    for k in range(len(into)):
        known[into[k]] += free[k]
    room = np.zeros(len(into), np.int32)
    # of a whole region: -1 until its first cell is met, 0 where it is too small
    number = np.full(len(into), -1, np.int32)
    count = 0
    for region in order:
        whole = into[region]
        if number[whole] < 0:
            large = whole > 0 and known[whole] * cell_area >= room_area
            count += large
            number[whole] = count if large else 0
        room[region] = number[whole]
    out = np.zeros(regions.shape, np.int32)
    for k in range(len(runs)):
        r, first, last = runs[k]
        found = room[regions[r, first]]
        regions[r, first:last] = found
        here, there = cells[r, first:last], out[r, first:last]
        for c in range(here.size):
            there[c] = 0 if here[c] == OCCUPIED else found
    return out


def run_merging(grid: OccupancyGrid, config: MergingConfig) -> Layout:
    """Rooms of a complete or partial, clean or cluttered grid."""
    return reconstruct_with(grid, config, load_models())


@with_unknown_around
def reconstruct_with(grid: OccupancyGrid, config: MergingConfig, models: MergingModels) -> Layout:
    """`run_merging` with other classifiers than the shipped ones."""
    if not has_free_space(grid):
        return empty_layout("default", grid, "the grid has no free cell")
    timer = StageTimer()
    regions = find_regions(grid.cells, grid.resolution, config, timer)
    with timer("merging"):
        labels, footprint, done = merge_into_rooms(regions, grid, config, models)
    with timer("walls"):
        structure = with_perpendicular(regions.structure)
        clutter = true_cells(turn_back(regions.clutter, regions.turned, grid.shape) & grid.occupied)
        clean = freed(grid, clutter)
        model = find_walls_of(clean, structure)
        chained = None if model is None else (model.aligned, model.walls, model.lines, grid.origin)
        walls = () if chained is None else Deferred(timer.timed("walls", partial(place_walls, *chained)))
        ends = np.zeros((0, 2)) if model is None else model.segments.reshape(-1, 2)
        segments = to_world(ends, grid.origin).reshape(-1, 4)
    details = MergingDetails(clean, clutter, labels, model, WALLS)
    rooms = partial(rooms_of_labels, labels, grid, footprint, details)
    return Layout(
        method="default",
        clean_grid=clean,
        labels=labels,
        rooms=Deferred(timer.timed("outlines", rooms)),
        directions=np.sort(angles_to_world(structure.directions, grid.origin)),
        structure_score=structure.score,
        segments=segments,
        walls=walls,
        timings=timer.seconds,
        warnings=(*_doubts(labels, structure), *regions.doubts, *_limits(model, len(ends) // 2, grid, done)),
        details=details,
    )


def _doubts(labels: Ints32, structure: Directions) -> Iterator[str]:
    if not labels.max(initial=0):
        yield "no room found: the free space is too small or too narrow"
    if not len(structure.directions):
        yield "no dominant direction: the map has no straight walls"
    elif structure.score > 0.4:
        yield f"structure score {structure.score:.2f} is above 0.4: do not trust the walls"


def _limits(model: WallModel | None, segments: int, grid: OccupancyGrid, done: bool) -> Iterator[str]:
    yield from left_out(grid.shape, segments, 0 if model is None else len(model.lines))
    if not done:
        yield "regions were left unmerged: the map has too many of them that touch"


def find_walls_of(clean: OccupancyGrid, structure: Directions) -> WallModel | None:
    """Walls and representative lines of a map without clutter, as ROSE2 finds them; None without a wall."""
    segments = find_segments(surfaces(clean.cells), clean.resolution, WALLS)
    chained = chain_walls(segments, structure, WALLS, most_lines(clean.shape))
    if chained is None:
        return None
    aligned, kept, walls, lines = chained
    return WallModel(clean_grid=clean, segments=segments[kept], aligned=aligned, walls=walls, lines=lines)


register_method(
    "default", "Learnt: watershed regions, merged by a classifier of pairs", run_merging, MergingConfig
)
