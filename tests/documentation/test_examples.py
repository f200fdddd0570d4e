"""The example scripts run as they are, in an empty folder."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

from layoutexplore.documentation.site import PAGES

EXAMPLES = sorted((PAGES.parent / "examples").glob("*.py"))


@pytest.mark.parametrize("script", EXAMPLES, ids=lambda script: script.stem)
def test_the_example_runs(
    script: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(script), run_name="__main__")
    assert capsys.readouterr().out.strip()


def test_the_scripts_are_found() -> None:
    assert len(EXAMPLES) >= 4
