"""The bar below the map in a frame: what runs where, the figures, and the coverage over the distance."""

from __future__ import annotations

import functools
import unicodedata
from collections.abc import Sequence
from typing import TYPE_CHECKING

import cv2
import numpy as np

from layoutexplore.drawing import palette
from layoutexplore.drawing.view import SHIFT
from layoutexplore.errors import checks_arguments
from layoutexplore.grids.arrays import Bytes, Floats

if TYPE_CHECKING:
    from layoutexplore.simulation.simulation import Simulation

_FONT = cv2.FONT_HERSHEY_SIMPLEX
Keys = Sequence[tuple[palette.Colour, str]]
"""Colours and what they mean."""

_LONGEST = 200
"""Characters of a name of which as many are drawn as there is room for."""

_SHORTEST = 14
"""Characters to which the name of a strategy is cut before what stands behind it."""

_REASONS = {
    "": "exploring",
    "coverage": "explored",
    "no_frontier": "nothing left to see",
    "budget": "budget spent",
    "agent": "stopped by the agent",
}


@checks_arguments
def draw_dashboard(simulation: Simulation, size: tuple[int, int], agent: str) -> Bytes:
    """The bar as uint8 (height, width, 3) RGB.

    Args:
        simulation: A simulation that has been reset.
        size: Width and height in pixels.
        agent: Name of the strategy; may be empty.
    """
    width, height = size
    image = np.full((height, width, 3), palette.PAPER, np.uint8)
    image[0] = palette.RULE
    pad = round(0.02 * width)
    left = [pad, round(0.36 * width), round(0.50 * width), round(0.645 * width)]
    state = _REASONS[simulation.stop_reason]
    behind = f"{simulation.lidar.config.name} lidar, {state}"
    _field(image, left[0], simulation.plan.name[:_LONGEST], behind, left[1] - left[0] - pad, agent[:_LONGEST])
    room = left[2] - left[1] - pad // 2
    _field(image, left[1], f"{100 * simulation.coverage:.1f} %", "coverage", room)
    room = left[3] - left[2] - pad // 2
    _field(image, left[2], f"{simulation.distance:.0f} m", "travelled", room)
    _draw_curve(image[1:, left[3] :], simulation.curve, simulation.config.coverage_goal, pad)
    return image


def put_text(
    image: Bytes,
    text: str,
    left: float,
    baseline: float,
    height: float,
    colour: palette.Colour,
    weight: int = 1,
) -> int:
    """Write a line of text; returns its width in pixels.

    Args:
        image: uint8 (height, width, 3), drawn into.
        text: Letters without an ASCII form are left out: OpenCV's own font has no others.
        left: Pixel column of the first letter.
        baseline: Pixel row of the baseline.
        height: Height of a capital letter in pixels.
        colour: Of the letters.
        weight: 1 regular, 2 bold.
    """
    plain = _ascii(text)
    scale = _scale(height)
    cv2.putText(image, plain, (round(left), round(baseline)), _FONT, scale, colour, weight, cv2.LINE_AA)
    return text_width(plain, height, weight)


def text_width(text: str, height: float, weight: int = 1) -> int:
    """Width in pixels of a text whose capital letters are `height` pixels high."""
    (width, _), _ = cv2.getTextSize(_ascii(text), _FONT, _scale(height), weight)
    return int(width)


@functools.lru_cache(maxsize=64)
def _scale(height: float) -> float:
    """OpenCV's font scale for capital letters of that height in pixels."""
    (_, capital), _ = cv2.getTextSize("H", _FONT, 10.0, 1)
    return 10.0 * height / float(capital)


def put_keys(image: Bytes, keys: Keys, left: float, middle: int, height: float) -> None:
    """Draw what colours mean in one line: dots with white rims, each with its words.

    Args:
        image: uint8 (height, width, 3), drawn into.
        keys: The colours and what they mean.
        left: Pixel column at which the line begins.
        middle: Pixel row of the middle of the dots.
        height: Height of a capital letter in pixels.
    """
    for colour, text in keys:
        put_dot(image, (round(left + height) << SHIFT, middle << SHIFT), 0.6 * height, colour)
        put_text(image, text, left + 2.5 * height, middle + height / 2, height, palette.FADED_INK)
        left += keys_width([(colour, text)], height)


def keys_width(keys: Keys, height: float) -> float:
    """Width in pixels of a line of `put_keys`, with the gap behind it."""
    return sum(5 * height + text_width(text, height) for _, text in keys)


def put_dot(image: Bytes, point: tuple[int, int], radius: float, colour: palette.Colour) -> None:
    """Draw a dot with a white rim.

    Args:
        image: uint8 (height, width, 3), drawn into.
        point: Its middle (x, y) in pixels times 2 ** SHIFT.
        radius: In pixels, without the rim.
        colour: Of the dot.
    """
    for size, fill in ((radius + 1.5, palette.WHITE), (radius, colour)):
        cv2.circle(image, point, round(size * (1 << SHIFT)), fill, cv2.FILLED, cv2.LINE_AA, SHIFT)


def _ascii(text: str) -> str:
    return unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()


def _field(image: Bytes, left: int, value: str, name: str, room: int, before: str = "") -> None:
    """A value in large letters over its name in small ones, shrunk or cut to fit into `room` pixels.

    What stands `before` the name is cut first.
    """
    high = image.shape[0]
    large, small = 0.22 * high, 0.135 * high
    large *= min(1.0, room / max(1, text_width(value, large, 2)))
    while len(before) > _SHORTEST and text_width(f"{before}, {name}", small) > room:
        before = before.removesuffix("...")[:-1] + "..."
    name = ", ".join(part for part in (before, name) if part)
    while len(name) > 4 and text_width(name, small) > room:
        name = name.removesuffix("...")[:-1] + "..."
    put_text(image, value, left, 0.47 * high, large, palette.INK, 2)
    put_text(image, name, left, 0.78 * high, small, palette.FADED_INK)


def _draw_curve(image: Bytes, curve: Floats, goal: float, pad: int) -> None:
    """Coverage over distance into a part of the bar; the axis grows in round steps."""
    height, width = image.shape[:2]
    small = 0.115 * height
    axis = _round_up(max(float(curve[-1, 0]), 20.0))
    label = f"{axis:g} m"
    left, right = 4 + text_width("100 %", small) + 8, width - pad
    top, bottom = round(0.18 * height), round(0.68 * height)
    for share, name in ((0.0, "0"), (1.0, "100 %")):
        row = round(bottom + (top - bottom) * share)
        cv2.line(image, (left, row), (right, row), palette.RULE, 1, cv2.LINE_AA)
        put_text(image, name, left - 8 - text_width(name, small), row + small / 2, small, palette.FADED_INK)
    put_text(image, label, right - text_width(label, small), bottom + 1.75 * small, small, palette.FADED_INK)
    xs = left + (right - left) * np.append(curve[:, 0], curve[-1, 0]) / axis
    ys = bottom + (top - bottom) * np.append(curve[:, 1], curve[-1, 1])
    line = np.round(np.stack([xs, ys], axis=1) * 16).astype(np.int32)
    area = np.concatenate([line, [[line[-1, 0], bottom * 16], [line[0, 0], bottom * 16]]])
    tint = image.copy()
    cv2.fillPoly(tint, [area.reshape(-1, 1, 2)], palette.SKY, cv2.LINE_AA, 4)
    cv2.addWeighted(tint, 0.35, image, 0.65, 0.0, dst=image)
    row = round(bottom + (top - bottom) * goal)
    for x in range(left, right, 8):
        cv2.line(image, (x, row), (min(x + 3, right), row), palette.VERMILLION, 1)
    cv2.polylines(image, [line.reshape(-1, 1, 2)], False, palette.BLUE, 2, cv2.LINE_AA, 4)
    cv2.circle(image, (int(line[-1, 0]), int(line[-1, 1])), 4 * 16, palette.BLUE, cv2.FILLED, cv2.LINE_AA, 4)


def _round_up(value: float) -> float:
    """The next of 1, 1.5, 2, 3, 5, 7.5 times a power of ten.

    Example:
        >>> [_round_up(v) for v in (20, 21, 160, 760)]
        [20.0, 30.0, 200.0, 1000.0]
    """
    power = 10.0 ** np.floor(np.log10(value))
    return float(next(step * power for step in (1, 1.5, 2, 3, 5, 7.5, 10) if step * power >= value - 1e-9))
