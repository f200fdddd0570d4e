"""The scale of a picture from a length that is known in it."""

from __future__ import annotations

import math
import re

from layoutexplore.errors import ConfigError, shortened

METRES = {
    "m": 1.0,
    "cm": 0.01,
    "mm": 0.001,
    "ft": 0.3048,
    "'": 0.3048,
    "in": 0.0254,
    "inch": 0.0254,
    '"': 0.0254,
}
"""Metres of a unit of length."""

PIXELS = ("px", "pixel", "pixels", "unit", "units")
"""Words for what a file measures in."""

_LENGTH = re.compile(r"\s*([0-9.]+(?:e[+-]?\d+)?)\s*([a-z'\"]+)\s*", re.IGNORECASE)


def metres_per_pixel(text: str) -> float:
    """Metres a pixel from a length that is known in a picture.

    Args:
        text: "3.2 m = 118 px", in any order; the units are m, cm, mm, ft and in. What a drawing measures in
            may be called px or units.

    Raises:
        ConfigError: It is not one length in pixels and one in a unit of length.

    Example:
        >>> metres_per_pixel("3.2 m = 64 px"), metres_per_pixel("10 px = 10ft")
        (0.05, 0.3048)
    """
    pixels, metres = math.nan, math.nan
    for part in text.split("="):
        match = _LENGTH.fullmatch(part)
        number = _number(match[1]) if match else math.nan
        unit = match[2].lower() if match else ""
        if unit in PIXELS:
            pixels = number
        elif unit in METRES:
            metres = number * METRES[unit]
    scale = metres / pixels if pixels > 0 and metres > 0 else math.nan
    if text.count("=") != 1 or not math.isfinite(scale):
        raise ConfigError(
            f"a known length is said as '3.2 m = 118 px' (m, cm, mm, ft, in), got {shortened(text)}"
        )
    return scale


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
