"""Pages from templates: one file each, nothing fetched, readable on a telephone, a dark screen and paper."""

from __future__ import annotations

import base64
import functools
import math
import re
from pathlib import Path
from typing import Any

from layoutexplore.drawing import palette
from layoutexplore.drawing.labels import names_apart
from layoutexplore.errors import require
from layoutexplore.grids.arrays import Bytes
from layoutexplore.grids.ros_map import encode_png
from layoutexplore.metrics.statistics import Interval

TEMPLATES = Path(__file__).parent

NBSP = "\N{NO-BREAK SPACE}"
"""Between a number and its unit."""


def render(template: str, **context: Any) -> str:
    """A template of this folder, filled in; what it is given is escaped, in HTML and in Markdown.

    Args:
        template: File name, such as "benchmark.html".
        context: What the template uses; `style` (the style sheet) and `colours` (of maps) are always there.
    """
    environment = _environment(markdown=template.endswith(".md"))
    return str(environment.get_template(template).render(style=_style(), colours=map_colours(), **context))


def map_colours(*, as_numbers: bool = False) -> dict[str, Any]:
    """What each colour of a map means, as CSS writes colours or as numbers."""
    named = {
        "canvas": palette.CANVAS,
        "unseen": palette.UNSEEN,
        "predicted": palette.PREDICTED,
        "free": palette.FREE,
        "wall": palette.WALL,
        "frontier": palette.FRONTIER,
        "closed": palette.CLOSED,
        "open": palette.OPEN,
        "robot": palette.ROBOT,
        "went": palette.TRACK_NEW,
        "given_up": palette.GIVEN_UP,
        "track": palette.TRACK_NEW,
        "planned": palette.PLANNED,
        "ink": palette.INK,
        "faded": palette.FADED_INK,
        "rule": palette.RULE,
        "seen": palette.SEEN,
        "right": palette.RIGHT,
        "wrong": palette.WRONG,
        "missed": palette.MISSED,
        "plan_wall": palette.BLUE,
        "otherwise": palette.VERMILLION,
    }
    if as_numbers:
        return {**named, "rooms": palette.ROOMS}
    return {name: palette.to_hex(colour) for name, colour in named.items()}


def number(value: float | None, digits: int = 2) -> str:
    """A number with fixed digits, or a dash where there is none.

    Example:
        >>> number(0.8571), number(float("nan")), number(1234.5, 0), number(-0.7), number(-0.001)
        ('0.86', '–', '1234', '−0.70', '0.00')
    """
    if value is None or not math.isfinite(value):
        return "–"
    return f"{value:z.{digits}f}".replace("-", "\N{MINUS SIGN}")


def percent(value: float | None, digits: int = 0) -> str:
    r"""A share as percent.

    Example:
        >>> percent(0.995, 1), percent(None), percent(-0.001), percent(-0.02)
        ('99.5\xa0%', '–', '0\xa0%', '−2\xa0%')
    """
    if value is None or not math.isfinite(value):
        return "–"
    return f"{100 * value:z.{digits}f}{NBSP}%".replace("-", "\N{MINUS SIGN}")


def points(value: float) -> str:
    """A difference of shares, in percent points with its sign.

    Example:
        >>> points(0.034), points(-0.0071), points(-0.0001)
        ('+3.4', '−0.7', '0.0')
    """
    text = f"{100 * value:+.1f}"
    return text[1:] if text[1:] == "0.0" else text.replace("-", "\N{MINUS SIGN}")


def interval(value: Interval | None) -> str:
    """An estimate with its interval, or a dash where there is none.

    Example:
        >>> nan = float("nan")
        >>> [interval(Interval(*ends)) for ends in ((0.861, 0.82, 0.9), (0.9, nan, nan), (nan, nan, nan))]
        ['0.86 (0.82–0.90)', '0.90', '–']
    """
    if value is None or not math.isfinite(value.estimate):
        return "–"
    if not math.isfinite(value.low):
        return f"{value.estimate:.2f}"
    return f"{value.estimate:.2f} ({value.low:.2f}–{value.high:.2f})"


def percents(value: Interval) -> str:
    r"""A share with its interval, in percent.

    Example:
        >>> percents(Interval(0.214, 0.11, 0.39)), percents(Interval(0.2, float("nan"), float("nan")))
        ('21\xa0% (11–39)', '20\xa0%')
    """
    if not math.isfinite(value.low):
        return percent(value.estimate)
    return f"{percent(value.estimate)} ({number(100 * value.low, 0)}–{number(100 * value.high, 0)})"


def png_uri(image: Bytes) -> str:
    """A picture uint8 (h, w) grey or (h, w, 3) RGB as a data URI."""
    return "data:image/png;base64," + base64.b64encode(encode_png(image)).decode()


def markdown(text: Any) -> Any:
    r"""Text that Markdown shows as it is: no element, no link, no column of a table.

    Example:
        >>> markdown("a|b <script>"), markdown("[x](y)"), markdown(3)
        ('a\\|b &lt;script&gt;', '\\[x\\](y)', 3)
    """
    if not isinstance(text, str):
        return text
    plain = " ".join(text.split("\n"))
    for letter, name in (("&", "&amp;"), ("<", "&lt;"), (">", "&gt;")):
        plain = plain.replace(letter, name)
    return re.sub(r"([\\`*|\[\]])", r"\\\1", plain)


def breakable(name: str) -> Any:
    """A name that may go on in a new line where its parts are joined.

    Example:
        >>> str(breakable("a.py:B:area=2"))
        'a.py:<wbr>B:<wbr>area=<wbr>2'
    """
    from markupsafe import Markup, escape

    return Markup("<wbr>").join(escape(part) for part in re.split(r"(?<=[/:,;=])", name))


def _code(text: str) -> Any:
    """Text for a code span or block, where nothing is read as Markdown: only its end must not come."""
    from markupsafe import Markup

    return Markup(" ".join(text.split("\n")).replace("`", "'"))


@functools.cache
def _environment(*, markdown: bool) -> Any:
    jinja2 = require("jinja2", "bench")
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=jinja2.select_autoescape(["html"]),
        finalize=_escaped if markdown else None,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters |= {
        "number": number,
        "percent": percent,
        "points": points,
        "interval": interval,
        "percents": percents,
        "code": _code,
        "names_apart": names_apart,
        "breakable": breakable,
    }
    return environment


def _escaped(value: Any) -> Any:
    """What a Markdown template shows of a value; text made for it passes as it is."""
    return value if hasattr(value, "__html__") else markdown(value)


def _style() -> Any:
    from markupsafe import Markup

    steps = ", ".join(map(palette.to_hex, palette.RAMP))
    named = {
        "better": palette.BETTER,
        "worse": palette.WORSE,
        "better-on-dark": palette.mix(palette.BETTER, palette.WHITE, 0.5),
        "worse-on-dark": palette.mix(palette.WORSE, palette.WHITE, 0.35),
    }
    colours = " ".join(f"--{name}: {palette.to_hex(colour)};" for name, colour in named.items())
    root = f":root {{ {colours} --ramp: linear-gradient(90deg, {steps}); }}\n"
    return Markup(root + (TEMPLATES / "style.css").read_text(encoding="utf-8"))
