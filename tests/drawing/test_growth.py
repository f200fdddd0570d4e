"""Lines over a growing size lie where their numbers say."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree

from layoutexplore.drawing.growth import HEIGHT, WIDTH, draw_growth


def points(svg: str) -> list[list[tuple[float, float]]]:
    return [
        [(float(x), float(y)) for x, y in re.findall(r"([\d.]+),([\d.]+)", line)]
        for line in re.findall(r'<polyline points="([^"]+)"', svg)
    ]


def test_equal_factors_are_equal_steps() -> None:
    svg = draw_growth({"a": ([(1, 10), (10, 100), (100, 1000)], [(1, 20), (100, 20)])}, "x", "y")
    ElementTree.fromstring(svg)
    rising, flat = points(svg)
    (x0, y0), (x1, y1), (x2, y2) = rising
    assert abs((x1 - x0) - (x2 - x1)) < 0.2 and x0 < x1 and abs((y1 - y0) - (y2 - y1)) < 0.2 and y1 < y0
    assert flat[0][1] == flat[1][1] and y1 < flat[0][1] < y0
    assert all(0 < x < WIDTH and 0 < y < HEIGHT for line in (rising, flat) for x, y in line)


def test_one_point_is_a_picture() -> None:
    svg = draw_growth({"a": ([(500.0, 3.0)], [(500.0, 3.0)])}, "area", "ms")
    ElementTree.fromstring(svg)
    assert "500" in svg and ">a<" in svg


def test_labels_of_lines_that_meet_stand_below_each_other() -> None:
    lines = {
        name: ([(1.0, 2.0), (9.0, end)], [(1.0, 2.0)]) for name, end in (("a", 50.0), ("b", 51.0), ("c", 2.0))
    }
    svg = draw_growth(lines, "x", "y")
    heights = {name: float(y) for y, name in re.findall(r'y="([\d.]+)" fill="#\w+">(\w)<', svg)}
    assert heights["c"] > heights["a"] >= heights["b"] + 14
