"""`explore --prior`, `evaluate registration` and `evaluate train-prior`."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
import shapely
from typer.testing import CliRunner

from layoutexplore.cli import app
from layoutexplore.cli.explore import with_prior
from layoutexplore.errors import ConfigError
from layoutexplore.maps.floorplan import FloorPlan, Room
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.tracing import floorplan_from_ascii
from tests.plans import HOUSE

runner = CliRunner()


def test_a_run_with_a_prior_plan_draws_it(tmp_path: Path) -> None:
    out = tmp_path / "run"
    words = [
        "explore",
        "apartment-01",
        "--agent",
        "layout-tour",
        "--prior",
        "apartment-01",
        "--out",
        str(out),
    ]
    result = runner.invoke(app, words)
    assert result.exit_code == 0, result.output
    assert list(out.glob("prior_*.png")) and "prior:apartment-01" in result.output
    line = next(line for line in result.output.splitlines() if line.startswith("prior plan"))
    assert re.search(r"believed at \d+ % of \d+ decisions, confidence [01]\.\d\d at the end", line)


def test_a_plan_that_tells_nothing_is_named(tmp_path: Path) -> None:
    hall = FloorPlan(name="hall", rooms=(Room(id=1, polygon=shapely.box(0, 0, 20, 10)),))
    save_plan(hall, tmp_path / "hall.geojson")
    words = ["explore", "apartment-01", "--agent", "layout-tour", "--prior", str(tmp_path / "hall.geojson")]
    result = runner.invoke(app, [*words, "--pause-after", "0"])
    assert result.exit_code == 0 and "not used, because it shows 1 room" in result.output


def test_a_photo_without_a_plan_ends_in_an_error_that_names_it(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (200, 300, 3)).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "photo.png"), noise)
    words = ["explore", "apartment-01", "--agent", "layout-tour", "--prior", str(tmp_path / "photo.png")]
    result = runner.invoke(app, [*words, "--pause-after", "0"])
    assert result.exit_code != 0 and "photo.png" in str(result.exception)


@pytest.mark.parametrize(
    ("agent", "prior", "scale", "message"),
    [
        ("nearest", "plan.png", None, "takes a predictor"),
        ("layout-tour:predictor=oracle", "plan.png", None, "names none"),
        ("layout-tour", None, 0.1, "give that, too"),
        ("layout-tour", "a;b.png", None, "must have none of"),
        ("layout-tour", "plan.png", 0.0, "^--prior-scale must be a finite number above 0"),
    ],
)
def test_nonsense_is_refused(agent: str, prior: str | None, scale: float | None, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        with_prior(agent, prior, scale)


def test_an_agent_keeps_its_options() -> None:
    found = with_prior("layout-tour:area=4", "plan.png", None)
    assert found == "layout-tour:area=4,predictor=prior:plan.png"
    assert with_prior("nearest", None, None) == "nearest"


def test_registrations_are_studied_and_one_building_is_too_few_to_learn_from(tmp_path: Path) -> None:
    words = ["apartment-01", "-s", "stage", "-k", "true", "-k", "wrong", "--out", str(tmp_path)]
    result = runner.invoke(app, ["evaluate", "registration", *words])
    assert result.exit_code == 0, result.output
    table = (tmp_path / "registration.md").read_text()
    assert "| true | 75% | 1 |" in table and "Calibration error" in table
    fitted = runner.invoke(app, ["evaluate", "train-prior", *words])
    assert fitted.exit_code != 0 and "two buildings" in str(fitted.exception)


def test_where_no_registration_is_right_or_wrong_there_is_no_calibration(tmp_path: Path) -> None:
    floors = [floorplan_from_ascii(HOUSE, name=f"tower-floor-{k}") for k in (1, 2)]
    for floor in floors:
        save_plan(dataclasses.replace(floor, building="tower"), tmp_path / f"{floor.name}.geojson")
    floor, out = tmp_path / "tower-floor-1.geojson", tmp_path / "out"
    words = ["evaluate", "registration", str(floor), "-k", "other-floor", "-s", "stage", "--out", str(out)]
    for among, said in (([], "No registration is judged"), (["--among", str(tmp_path)], "Milliseconds of")):
        result = runner.invoke(app, [*words, *among])
        assert result.exit_code == 0, result.output
        table = (out / "registration.md").read_text()
        assert said in table and "Calibration" not in table


def test_unknown_kinds_are_refused(tmp_path: Path) -> None:
    result = runner.invoke(
        app, ["evaluate", "registration", "apartment-01", "-k", "tru", "--out", str(tmp_path)]
    )
    assert result.exit_code != 0
