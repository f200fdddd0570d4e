"""Lines over a growing size, as an SVG picture: cost against area, one colour a kind of line."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from layoutexplore.drawing.labels import label_places
from layoutexplore.drawing.palette import QUALITATIVE, Colour, to_hex
from layoutexplore.errors import ConfigError, checks_arguments

WIDTH, HEIGHT = 640, 400
_LEFT, _RIGHT, _TOP, _BOTTOM = 64, 150, 24, 48
_LABEL_HEIGHT = 14

Line = Sequence[tuple[float, float]]
"""Points (x, y), both above 0."""


@checks_arguments
def draw_growth(lines: Mapping[str, tuple[Line, Line]], x_title: str, y_title: str) -> str:
    """A picture with logarithmic axes, as SVG.

    Args:
        lines: By name a solid and a dashed line, at least one point each.
        x_title: What x is, with its unit.
        y_title: What y is, with its unit.
    """
    if not lines or not all(line for pair in lines.values() for line in pair):
        raise ConfigError("draw_growth: there must be a line, each with one point at least")
    points = [point for pair in lines.values() for line in pair for point in line]
    xs, ys = ([point[axis] for point in points] for axis in (0, 1))
    frame = _Frame(min(xs), max(xs), min(ys) / 1.2, max(ys) * 1.2)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" '
        f'font-size="12"><rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
        *frame.grid(sorted(set(xs))),
        f'<text x="{_LEFT}" y="{HEIGHT - 10}">{x_title}</text>',
        f'<text x="{_LEFT}" y="{_TOP - 8}">{y_title}</text>',
    ]
    labels = label_places([frame.at(*solid[-1])[1] for solid, _ in lines.values()], _LABEL_HEIGHT)
    for k, (name, (solid, dashed)) in enumerate(lines.items()):
        colour = QUALITATIVE[k % len(QUALITATIVE)]
        parts += [frame.line(solid, colour, ""), frame.line(dashed, colour, ' stroke-dasharray="5 4"')]
        x, _ = frame.at(*solid[-1])
        parts.append(f'<text x="{x + 8:.1f}" y="{labels[k] + 4:.1f}" fill="{to_hex(colour)}">{name}</text>')
    return "\n".join([*parts, "</svg>", ""])


class _Frame:
    """Where points lie in the picture.

    Args:
        x0: Least x; likewise `x1`, `y0`, `y1`.
        x1: Greatest x.
        y0: Least y.
        y1: Greatest y.
    """

    def __init__(self, x0: float, x1: float, y0: float, y1: float) -> None:
        self._x0, self._x1 = math.log(x0), math.log(max(x1, x0 * 1.01))
        self._y0, self._y1 = math.log(y0), math.log(max(y1, y0 * 1.01))

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Pixels from the left and from the top."""
        across = (math.log(x) - self._x0) / (self._x1 - self._x0)
        up = (math.log(y) - self._y0) / (self._y1 - self._y0)
        return _LEFT + across * (WIDTH - _LEFT - _RIGHT), HEIGHT - _BOTTOM - up * (HEIGHT - _TOP - _BOTTOM)

    def grid(self, xs: Sequence[float]) -> list[str]:
        """Lines and labels at these x, and at the 1, 2 and 5 of each decade of y."""
        low, high = math.exp(self._y0), math.exp(self._y1)
        steps = [d * 10.0**k for k in range(-6, 7) for d in (1, 2, 5)]
        found = []
        for y in (step for step in steps if low * 0.999 <= step <= high * 1.001):
            left, top = self.at(math.exp(self._x0), y)
            found.append(f'<path d="M{left:.1f} {top:.1f}H{WIDTH - _RIGHT}" stroke="#dcdfe4"/>')
            found.append(f'<text x="{left - 8:.1f}" y="{top + 4:.1f}" text-anchor="end">{y:g}</text>')
        for x in xs:
            left, bottom = self.at(x, low)
            found.append(f'<path d="M{left:.1f} {_TOP}V{bottom:.1f}" stroke="#eceef2"/>')
            found.append(f'<text x="{left:.1f}" y="{bottom + 18:.1f}" text-anchor="middle">{x:g}</text>')
        return found

    def line(self, points: Line, colour: Colour, dashes: str) -> str:
        """A line through points."""
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in (self.at(*point) for point in points))
        return f'<polyline points="{path}" fill="none" stroke="{to_hex(colour)}" stroke-width="2"{dashes}/>'
