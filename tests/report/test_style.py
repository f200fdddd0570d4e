"""The style of all pages: on a light and a dark screen, and on paper."""

from __future__ import annotations

import re

import pytest

from layoutexplore.report.templates import TEMPLATES, render


@pytest.fixture(scope="module")
def style() -> str:
    pytest.importorskip("jinja2")
    page = render("replay_page.html", title="t", command="c", replay=None)
    return re.split("</?style>", page)[1]


def block(style: str, head: str) -> str:
    """What stands between the braces after a head."""
    begin = style.index(head) + len(head)
    depth = 1
    for k in range(style.index("{", begin) + 1, len(style)):
        depth += {"{": 1, "}": -1}.get(style[k], 0)
        if not depth:
            return style[begin : k + 1]
    raise AssertionError(f"{head} has no end")


def test_a_dark_page_has_every_colour_of_a_light_one(style: str) -> None:
    light = set(re.findall(r"--(?!better|worse|ramp)([\w-]+): ", block(style, "#replay-curve, .ways svg")))
    dark = set(re.findall(r"--([\w-]+): ", block(style, "(prefers-color-scheme: dark)")))
    assert {"ink", "paper", "ground", "blue", "orange"} <= dark <= light
    assert light - dark == {"faint"}, "lines within figures, which a dark page turns with them"
    templates = style + "".join(path.read_text() for path in TEMPLATES.rglob("*.html"))
    used = set(re.findall(r"var\(--([\w-]+)\)", templates))
    assert used <= set(re.findall(r"--([\w-]+): ", templates))


def test_paper_is_white_and_shows_the_whole_table(style: str) -> None:
    assert "@media screen and (prefers-color-scheme: dark)" in style, "not on paper"
    paper = block(style, "@media print")
    assert re.search(r"\.scroll \{[^}]*overflow: visible", paper), "wide tables were cut off"
    assert "print-color-adjust: exact" in paper, "browsers leave out backgrounds, which dots and bars are"


def test_a_narrow_page_has_room_for_words_and_pictures(style: str) -> None:
    narrow = block(style, "@media (max-width: 640px)")
    assert re.search(r"body \{[^}]*overflow-wrap: break-word", style), "headings hold names of maps and files"
    assert re.search(r"table\.words td:last-child \{[^}]*overflow-wrap: anywhere; min-width: 11em", narrow)
    assert re.search(r"table\.words td:first-child \{[^}]*min-width: 7em", narrow)
    page = (TEMPLATES / "studies" / "in_the_loop.html").read_text()
    assert re.search(r"<img [^>]*min-width: \d+px", page), "as narrow as the head of its column"
