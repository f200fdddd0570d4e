"""Every code block of the pages runs: Python in one namespace a page, commands in one folder a page.

A block with a title is a file that the reader is asked to write. A comment before a block says what else:
`<!-- slow -->` runs with `-m slow` only, `<!-- not run: WHY -->` never; all commands are parsed.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from layoutexplore.cli import app
from layoutexplore.documentation.site import PAGES
from layoutexplore.grids.ros_map import save_grid
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.library import load_plan
from tests.test_readme import parse

FOUND = sorted(PAGES.rglob("*.md"))
FENCE = re.compile(
    r"(?:<!-- (?P<mark>[^>]+) -->\n+)?"
    r"```(?P<language>\w+)(?: title=\"(?P<title>[^\"]+)\")?\n(?P<code>.*?)```",
    re.DOTALL,
)


class Block(NamedTuple):
    """A piece of code of a page."""

    language: str
    code: str
    title: str | None
    mark: str

    @property
    def commands(self) -> list[list[str]]:
        """The words of each call of `layoutexplore`."""
        lines = self.code.replace("\\\n", " ").splitlines()
        return [shlex.split(line, comments=True)[1:] for line in lines if line.startswith("layoutexplore ")]


def blocks(page: Path) -> list[Block]:
    text = page.read_text()
    return [Block(m["language"], m["code"], m["title"], m["mark"] or "") for m in FENCE.finditer(text)]


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder with what a reader has: a ROS map `floor.yaml`, a floor plan, a picture of one."""
    plan = load_plan("apartment:3")
    save_plan(plan, tmp_path / "plan.geojson")
    grid = plan.rasterize(0.05).grid
    save_grid(grid, tmp_path / "floor.yaml")
    picture = np.where(grid.cells[::-1] == 0, 255, 0).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "floor.png"), picture)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path


def run(page: Path, place: Path, *, slow: bool) -> int:
    """Runs the blocks of a page in turn and returns how many there were."""
    names: dict[str, Any] = {"__name__": "page"}
    done = 0
    for block in blocks(page):
        if block.mark.startswith("not run") or (block.mark == "slow" and not slow):
            continue
        if block.title is not None:
            (place / block.title).write_text(block.code)
        elif block.language == "python":
            exec(compile(block.code, str(page), "exec"), names)
        elif block.language == "bash":
            for words in block.commands:
                result = CliRunner().invoke(app, words)
                assert result.exit_code == 0, f"{' '.join(words)}\n{result.output}\n{result.exception!r}"
        done += 1
    return done


@pytest.mark.parametrize("page", FOUND, ids=lambda page: page.stem)
def test_the_page_runs(page: Path, place: Path) -> None:
    run(page, place, slow=False)


@pytest.mark.slow
@pytest.mark.parametrize("page", FOUND, ids=lambda page: page.stem)
def test_the_page_runs_with_what_takes_long(page: Path, place: Path) -> None:
    run(page, place, slow=True)


@pytest.mark.parametrize("page", FOUND, ids=lambda page: page.stem)
def test_commands_parse_and_marks_have_a_meaning(page: Path) -> None:
    for block in blocks(page):
        assert block.mark in ("", "slow") or block.mark.startswith("not run: "), block.mark
        for words in block.commands:
            parse(words)


def test_most_pages_hold_code_that_runs() -> None:
    held = [page for page in FOUND if any(not block.mark.startswith("not run") for block in blocks(page))]
    assert len(held) >= 4


def test_a_block_that_fails_fails_the_page(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("```bash\nlayoutexplore maps show nowhere\n```\n")
    with pytest.raises(AssertionError, match="nowhere"):
        run(page, tmp_path, slow=False)
