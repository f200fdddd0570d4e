"""School layouts against stretched floor plans, and ROSE's clutter study."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely

from layoutexplore.errors import MapError
from layoutexplore.evaluation.layouts import (
    facing_outlines,
    read_outlines,
    score_layout,
    score_polygons,
    stretch,
)
from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.grids.ros_map import load_grid
from layoutexplore.layout.pipeline import reconstruct
from layoutexplore.layout.types import empty_layout

XML = """<building><floor><spaces>
<space><bounding_polygon>
<point x="0" y="0"/><point x="10" y="0"/><point x="10" y="5"/><point x="0" y="5"/>
</bounding_polygon></space>
<space><bounding_polygon>
<point x="10" y="0"/><point x="20" y="0"/><point x="20" y="5"/>
</bounding_polygon></space>
</spaces></floor></building>"""


def test_coverages_of_a_hand_case():
    truth = [shapely.box(0, 0, 4, 4), shapely.box(4, 0, 8, 4)]
    found = [shapely.box(0, 0, 6, 4), shapely.box(6, 0, 8, 4)]
    scores = score_polygons(found, truth)
    assert scores.a_fc == pytest.approx((16 + 8) / 32)
    assert scores.a_bc == pytest.approx((16 + 8) / 32)
    assert scores.precision == pytest.approx((16 / 24 + 1) / 2)
    assert scores.recall == pytest.approx((1 + 8 / 16) / 2)
    assert (scores.rooms, scores.true_rooms) == (2, 2)
    assert score_polygons([], truth).a_bc == 0


def test_outlines_are_read_and_stretched(tmp_path):
    path = tmp_path / "school_gt.xml"
    path.write_text(XML)
    rooms = read_outlines(path)
    assert [r.area for r in rooms] == [50, 25]
    moved = stretch(rooms, (1, 1, 5, 3))
    assert tuple(shapely.total_bounds(np.array(moved))) == pytest.approx((1, 1, 5, 3))
    assert [r.area for r in moved] == pytest.approx([4, 2])


@pytest.mark.parametrize(
    "text",
    [
        "not xml",
        "<building/>",
        "<bounding_polygon><point x='1' y='wide'/></bounding_polygon>",
        "<bounding_polygon><point x='1'/></bounding_polygon>",
        "<bounding_polygon><point x='nan' y='0'/></bounding_polygon>",
    ],
)
def test_broken_floor_plans_are_named(tmp_path, text):
    path = tmp_path / "broken.xml"
    path.write_text(text)
    with pytest.raises(MapError, match=r"broken\.xml"):
        read_outlines(path)


def test_a_layout_without_rooms_scores_nothing():
    layout = empty_layout("ias15", OccupancyGrid(np.zeros((3, 3), np.int8), 0.1), "nothing")
    assert score_layout(layout, [shapely.box(0, 0, 1, 1)]).a_bc == 0


def test_the_truth_is_scored_the_way_round_that_fits_the_free_space() -> None:
    # an L of two rooms, one above the other at the left end of a long one
    truth = [shapely.box(0, 0, 60, 20), shapely.box(0, 20, 20, 60)]
    cells = np.full((64, 64), 100, np.int8)
    cells[3:21, 3:61] = cells[23:61, 3:21] = 0
    for flipped, grid in ((False, cells), (True, cells[::-1])):
        rooms, is_mirrored = facing_outlines(truth, OccupancyGrid(np.ascontiguousarray(grid), 0.1))
        assert is_mirrored == flipped
        stands = [room.centroid.y for room in rooms]
        assert (stands[0] > stands[1]) == flipped
    assert facing_outlines(truth, OccupancyGrid(np.full((9, 9), -1, np.int8), 0.1))[1] is False


def test_authors_maps_keep_their_truth(data_dir: Path) -> None:
    for image in sorted((data_dir / "gridmaps" / "schools").glob("*.png")):
        truth = read_outlines(image.with_name(f"{image.stem}_gt.xml"))
        assert not facing_outlines(truth, load_grid(image, resolution=0.1))[1], image.stem


@pytest.mark.slow
def test_school_maps_reach_the_published_coverages(data_dir):
    folder = data_dir / "gridmaps" / "schools"
    scores = [
        score_layout(
            reconstruct(load_grid(path, resolution=0.1), "ias15"),
            read_outlines(folder / f"{path.stem}_gt.xml"),
        )
        for path in sorted(folder.glob("*.png"))
    ]
    assert np.mean([s.a_bc for s in scores]) > 0.865
    assert np.mean([s.a_fc for s in scores]) > 0.877
