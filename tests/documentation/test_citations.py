"""Papers are cited by all of their authors."""

from __future__ import annotations

import re
from pathlib import Path

from layoutexplore.documentation.site import PAGES

ROOT = Path(__file__).parents[2]
AUTHORS = {"AAMAS 2021": "Luperto, Fochetta and Amigoni", "ICRA 2019": "Luperto, Arcerito and Amigoni"}
CITED = re.compile(rf"((?:[A-Z]\w+, )*[A-Z]\w+ and [A-Z]\w+),? \(?({'|'.join(AUTHORS)})")


def test_authors_of_papers_are_named_as_they_are() -> None:
    folders = [ROOT / name for name in ("agents", "envs", "maps", "layoutexplore")]
    files = [file for folder in folders for file in folder.rglob("*.py")] + [*PAGES.rglob("*.md")]
    cited = [found for file in files for found in CITED.findall(" ".join(file.read_text().split()))]
    assert len(cited) > 3
    assert {found for found in cited if found[0] != AUTHORS[found[1]]} == set()
