"""School layouts against stretched floor plans, and ROSE's clutter study."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from layoutexplore.errors import MapError
from layoutexplore.evaluation.layouts import read_outlines, score_layout, score_polygons, stretch
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
