"""Studies that were stopped go on where they were: what was scored is kept, and made once."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from layoutexplore.evaluation import clutter, cross_validation, segmentation
from layoutexplore.evaluation.clutter import ClutterConfig, run_study
from layoutexplore.evaluation.cross_validation import (
    CrossValidationConfig,
    cross_validate_merging,
    leave_sources_out,
)
from layoutexplore.evaluation.segmentation import evaluate_cases
from layoutexplore.maps.painted_rooms import find_cases
from tests.evaluation.cases import watch_merging_trainings
from tests.evaluation.test_clutter import hall, turned_room
from tests.maps.test_painted_rooms import paint


def stop_at_call(monkeypatch: pytest.MonkeyPatch, module: object, name: str, number: int) -> None:
    """Ctrl-C at such a call of a function of a module."""
    real, calls = getattr(module, name), iter(range(1, 1000))

    def stopped(*args: object, **options: object) -> object:
        if next(calls) == number:
            raise KeyboardInterrupt
        return real(*args, **options)

    monkeypatch.setattr(module, name, stopped)


@pytest.mark.parametrize("by_source", [False, True])
def test_maps_held_out_are_scored_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, by_source: bool
) -> None:
    learnt = watch_merging_trainings(monkeypatch)
    names = [["flat"], ["barn", "mill"]]
    for k, folder in enumerate(names):
        (tmp_path / f"maps-{k}").mkdir()
        for j, name in enumerate(folder):
            paint(tmp_path / f"maps-{k}", name, 40 + 4 * k + 8 * j)
    folders = [tmp_path / "maps-0", tmp_path / "maps-1"]
    cases = find_cases(folders, {"flat": "flat", "barn": "farm", "mill": "farm"})
    config = CrossValidationConfig(folds=2, protocol="rose2", resolution=0.05, simulated=3)
    validate, store = leave_sources_out if by_source else cross_validate_merging, tmp_path / "scores"
    plain = [*validate(cases, config)]
    trained = len(learnt)
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        stop_at_call(patch, cross_validation, "score_case", 3)
        [*validate(cases, config, store=store)]
    assert len(learnt) == 2 * trained and len([*store.iterdir()]) == 2
    again = [*validate(cases, config, store=store)]
    assert len(learnt) == 2 * trained + 1  # the part that was whole is not trained again
    assert [(case, labels.tolist()) for case, _, labels in again] == [
        (case, labels.tolist()) for case, _, labels in plain
    ]
    scores = [
        [(row.map, row.source, row.fold, row.iou_s, row.rooms) for _, row, _ in found]
        for found in (plain, again)
    ]
    assert scores[0] == scores[1]
    monkeypatch.setattr(cross_validation, "training_examples", None)  # nothing is made where all is kept
    [*validate(cases, config, store=store)]
    paint(folders[0], "flat", 60)
    monkeypatch.undo()
    watch_merging_trainings(monkeypatch)
    [*validate(cases, config, store=store)]
    assert len([*store.iterdir()]) == 6  # another map: what had learnt from the old one is not taken


def test_methods_score_a_map_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = tmp_path / "scores"
    for k, name in enumerate(("barn", "flat", "mill")):
        paint(tmp_path, name, 40 + 4 * k)
    cases, methods = find_cases([tmp_path]), ("doorways", "distance")

    def evaluate(jobs: int = 1, methods: tuple[str, ...] = methods) -> list[tuple[Any, ...]]:
        found = evaluate_cases(cases, methods, protocol="rose2", resolution=0.05, jobs=jobs, store=store)
        return [(case, replace(row, ms=0.0), labels.tolist()) for case, row, labels in found]

    plain = [
        (case, replace(row, ms=0.0), labels.tolist())
        for case, row, labels in evaluate_cases(cases, methods, protocol="rose2", resolution=0.05)
    ]
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        stop_at_call(patch, segmentation, "score_case", 4)
        evaluate()
    assert len([*store.iterdir()]) == 3
    with monkeypatch.context() as patch:
        stop_at_call(patch, segmentation, "score_case", 4)  # three are left to do
        assert evaluate() == plain
    with monkeypatch.context() as patch:
        patch.setattr(segmentation, "score_case", None)
        assert evaluate() == plain and evaluate(methods=methods[::-1])[1] == plain[0]
    assert evaluate(jobs=2) == plain and len([*store.iterdir()]) == 12  # beside another its times are others
    damaged = next(store.iterdir())
    damaged.write_bytes(damaged.read_bytes()[:-30])
    with pytest.warns(UserWarning, match="made anew"):
        assert evaluate() + evaluate(jobs=2) == 2 * plain
    paint(tmp_path, "flat", 60)
    evaluate()
    assert len([*store.iterdir()]) == 14  # another map


def test_clutter_is_added_once_to_a_map(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    maps = {"a/hall.png": hall(), "b/hall.png": hall(), "room.png": turned_room(0.2)}
    config = ClutterConfig(shapes=("square",), counts=(40,), sizes=(9, 14))
    plain = run_study(maps, config)
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        stop_at_call(patch, clutter, "add_clutter", 5)
        run_study(maps, config, store=tmp_path)
    assert len([*tmp_path.iterdir()]) == 2
    stop_at_call(monkeypatch, clutter, "add_clutter", 3)  # two are left to do
    assert repr(run_study(maps, config, store=tmp_path)) == repr(plain)
    damaged = next(tmp_path.iterdir())
    damaged.write_bytes(damaged.read_bytes()[:-30])
    monkeypatch.undo()
    with pytest.warns(UserWarning, match="made anew"):
        assert repr(run_study(maps, config, store=tmp_path)) == repr(plain)
