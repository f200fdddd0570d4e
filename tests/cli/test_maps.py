"""The commands around floor plans."""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import pytest
import typer
from typer.testing import CliRunner

from layoutexplore.errors import LayoutExploreError, UnknownNameError
from layoutexplore.maps import load_plan
from tests.maps.cases import share_reached, write_houseexpo


def invoke(*words: str) -> tuple[int, str]:
    from layoutexplore.cli import maps

    app = typer.Typer()
    maps.register(app)
    result = CliRunner().invoke(app, ["maps", *words])
    if isinstance(result.exception, LayoutExploreError):
        raise result.exception
    return result.exit_code, result.output


def test_command_line(tmp_path: Path) -> None:
    source = write_houseexpo(tmp_path)
    target, picture = tmp_path / "house.geojson", tmp_path / "house.png"
    assert invoke("import", str(source), "--out", str(target))[0] == 0
    code, text = invoke("show", str(target), "--out", str(picture))
    assert code == 0
    assert "kitchen" in text
    assert cv2.imread(str(picture)) is not None
    assert invoke("list")[0] == 0
    assert invoke("generate", "apartment", "--seed", "1", "--out", str(tmp_path / "flat.geojson"))[0] == 0
    assert share_reached(load_plan(tmp_path / "flat.geojson")) > 0.9
    with pytest.raises(UnknownNameError):
        invoke("show", "nothing-like-this")
    shutil.rmtree(tmp_path)
