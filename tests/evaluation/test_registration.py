"""The study of registrations: rows, resuming, calibration."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from layoutexplore import cli
from layoutexplore.errors import ResultsError
from layoutexplore.evaluation.registration import (
    RegistrationRow,
    confidences,
    moments_of,
    registration_rows,
    rows_until,
    score_registrations,
)
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.library import load_plan
from layoutexplore.priors.confidence import FEATURES
from layoutexplore.priors.presets import StudyPrior, study_prior


def row(
    kind: str, coverage: float, error: float, building: str = "a", feature: float = 0.5
) -> RegistrationRow:
    return RegistrationRow(
        plan=building,
        building=building,
        sensor="stage",
        kind=kind,
        coverage=coverage,
        features=(feature,) * len(FEATURES),
        error=error,
        first_ms=1.0,
        median_ms=1.0,
        p95_ms=1.0,
    )


def test_a_floor_gives_rows_and_is_not_explored_twice(tmp_path: Path) -> None:
    plan = load_plan("apartment-01")
    first = registration_rows(plan, ["true", "empty"], store=tmp_path)
    assert {r.kind for r in first} == {"true", "empty"} and first[0].building == plan.building
    assert all(np.isinf(r.error) and not r.features for r in first if r.kind == "empty")
    last = [r for r in first if r.kind == "true"][-1]
    assert last.right and len(last.features) == len(FEATURES)
    assert registration_rows(plan, ["true", "empty"], store=tmp_path) == first  # times, too: they were read


def test_rows_with_other_features_are_made_anew(tmp_path: Path) -> None:
    plan = load_plan("apartment-01")
    first = registration_rows(plan, ["true"], store=tmp_path)
    path = next(tmp_path.glob("*.json"))
    table = json.loads(path.read_text())
    path.write_text(json.dumps([{**row, "features": row["features"][:-1]} for row in table]))
    again = registration_rows(plan, ["true"], store=tmp_path)
    assert [row.features for row in again] == [row.features for row in first]


def test_rows_of_another_version_are_made_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = load_plan("apartment-01")
    registration_rows(plan, ["empty"], store=tmp_path)
    (path,) = tmp_path.iterdir()
    path.write_text(path.read_text().replace('"building": "', '"building": "old '))
    assert {row.building for row in registration_rows(plan, ["empty"], store=tmp_path)} != {plan.building}
    monkeypatch.setattr("layoutexplore.__version__", "999")
    assert {row.building for row in registration_rows(plan, ["empty"], store=tmp_path)} == {plan.building}


@pytest.mark.parametrize("text", ["", "{}", "[{}]", "[1]", '[{"plan": "x", "error": null}]'])
def test_a_damaged_file_of_rows_is_told(text: str, tmp_path: Path) -> None:
    plan = load_plan("apartment-01")
    registration_rows(plan, ["empty"], store=tmp_path)
    (path,) = tmp_path.iterdir()
    path.write_text(text)
    with pytest.raises(ResultsError, match=rf"{path.name}.*delete the file"):
        registration_rows(plan, ["empty"], store=tmp_path)


def test_rows_of_other_floors_are_kept_by_where_these_come_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []

    def prior_of(kind: str, plan: FloorPlan, seed: int, *, among: str) -> StudyPrior:
        asked.append(among)
        return study_prior("empty", plan, seed)

    monkeypatch.setattr("layoutexplore.evaluation.registration.study_prior", prior_of)
    plan, one, two = load_plan("apartment-01"), str(tmp_path / "one.geojson"), "apartment-02"
    save_plan(load_plan("apartment-02"), Path(one))

    def ask(*places: str) -> list[str]:
        asked.clear()
        for among in places:
            assert registration_rows(plan, ["other-floor"], among=among, store=tmp_path / "rows")
        return list(asked)

    assert ask(one, two, one, "", two) == [one, two, ""]
    save_plan(load_plan("apartment-03"), Path(one))
    assert ask(one, two, one) == [one]


def test_moments_are_what_had_been_seen() -> None:
    rows = [row("true", 0.0, 1.0), row("true", 0.1, 1.0), row("true", 0.0, 1.0), row("wrong", 0.0, 1.0)]
    shares = [moment[-1] for moment in moments_of(rows)]
    assert shares == [0.0, 0.1, 0.1, 0.0]


def test_rows_end_where_so_much_has_been_seen() -> None:
    rows = [row("true", 0.0, 1.0), row("wrong", 0.5, 2.0), row("true", 0.5, 3.0), row("wrong", 0.0, 4.0)]
    rows += [row("true", 0.75, 5.0)]
    assert [kept.error for kept in rows_until(rows, 0.5)] == [1.0, 2.0, 3.0]
    assert rows_until(rows, 0.9) == rows


def test_a_kind_without_another_floor_is_left_out() -> None:
    assert registration_rows(load_plan("apartment-01"), ["other-floor"]) == []


def test_scores_by_kind_and_share() -> None:
    rows = [row("true", 0.25, 0.2), row("true", 0.25, 5.0, "b"), row("wrong", 0.25, np.inf)]
    true, wrong = score_registrations(rows, sure=0.0)
    assert (true.floors, true.right.estimate, true.error) == (2, 0.5, pytest.approx(2.6))
    assert true.wrongly == 0.5 and wrong.wrongly == 1.0 and wrong.right.estimate == 0.0


def test_no_hypothesis_is_no_confidence() -> None:
    lost = RegistrationRow(**{**row("true", 0.1, np.inf).__dict__, "features": ()})
    assert confidences([lost]).tolist() == [0.0]


def test_what_is_named_twice_is_registered_once(tmp_path: Path) -> None:
    arguments = ["apartment-01", "--out", str(tmp_path), *("-k", "empty", "-s", "stage") * 2]
    result = CliRunner().invoke(cli.app, ["evaluate", "registration", *arguments])
    assert result.exit_code == 0 and "1/1 explorations" in result.output, result.output
    lines = [line.split("|") for line in result.output.splitlines() if line.startswith("| empty")]
    assert lines and all(line[3].strip() == "1" for line in lines)
