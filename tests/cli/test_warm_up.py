"""What is warmed up."""

from __future__ import annotations

from functools import partial
from importlib import resources
from pathlib import Path

import pytest
from typer.testing import CliRunner

from layoutexplore.cli import app, warm_up
from layoutexplore.cli.warm_up import compile_missing, warm_up_steps
from layoutexplore.layout.merging.walls.raggedness import is_ragged
from layoutexplore.layout.pipeline import LAYOUTS, method_names
from layoutexplore.processes import kernel_list
from layoutexplore.processes.compilation import LISTENER
from layoutexplore.processes.kernel_list import LARGE_MAP
from layoutexplore.sensing.lidar import SENSORS


def test_every_method_and_sensor_is_warmed_up() -> None:
    names = {name for name, _ in warm_up_steps()}
    own = {entry.name for entry in LAYOUTS.own()}  # of tests that ran before
    assert {f"layout method {name}" for name in method_names() if name not in own} <= names
    assert {f"sensor {name}" for name in SENSORS} <= names


def test_a_map_with_ragged_walls_is_among_them() -> None:
    step = dict(warm_up_steps())["ragged walls"]
    assert isinstance(step, partial)
    grid = step.keywords["of"]()
    assert is_ragged(grid.cells, grid.resolution)
    assert "borders" not in " ".join(step().warnings)


WITH_ROOMS = {"agent layout-tour", "a whole exploration"}


@pytest.mark.parametrize(
    ("words", "needed"),
    [
        (["explore", "PLAN", "--agent", "nearest"], {"agent nearest"}),
        (["explore", "PLAN", "--agent", "layout-tour:patience=1"], WITH_ROOMS),
        (["explore", "PLAN", "--sensor", "indoor"], {"agent nearest", "sensor indoor"}),
        (["explore", "PLAN", "--noise", "low"], {"agent nearest", "sensor stage"}),
        (["layout", "PLAN", "--method", "morphological"], {"layout method morphological"}),
    ],
)
def test_commands_compile_what_they_need_on_all_cores(
    words: list[str], needed: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert asked(words, monkeypatch) == {"a floor plan", *needed}


@pytest.mark.parametrize(
    ("resolution", "region", "is_large"),
    [("0.01", [], True), ("0.1", [], False), ("0.01", ["--region", "0,0 2,0 2,2"], False)],
)
def test_of_a_large_plan_they_compile_more(
    resolution: str, region: list[str], is_large: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "fine.toml").write_text(f"[simulation]\nresolution = {resolution}\n")
    uses = asked(["explore", "PLAN", "--config", str(tmp_path / "fine.toml"), *region], monkeypatch)
    assert (LARGE_MAP in uses) == is_large


def asked(words: list[str], monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """What a command, with PLAN for an apartment, says that it needs compiled."""

    class AskedError(Exception):
        pass

    def note(uses: set[str]) -> None:
        raise AskedError(*sorted(uses))

    monkeypatch.setattr(warm_up, "compile_missing", note)
    plan = str(resources.files("layoutexplore.maps") / "plans" / "apartment-01.geojson")
    done = CliRunner().invoke(app, [plan if word == "PLAN" else word for word in words])
    assert isinstance(done.exception, AskedError)
    assert set(done.exception.args) <= {name for name, _ in warm_up_steps()}
    return set(done.exception.args)


def test_it_is_shown_how_far_it_is_and_nothing_where_nothing_is_missing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(LISTENER, "is_silent", False)
    missing = kernel_list.listed_kernels(["agent nearest"])[:3]
    monkeypatch.setattr(kernel_list, "compile_kernels", lambda kernels, jobs, told: told(3, len(kernels)))
    for found, words in ((missing, "3/3 kernels compiled"), ([], "")):
        monkeypatch.setattr(kernel_list, "missing_kernels", lambda uses, found=found: found)
        compile_missing(["agent nearest"])
        out, err = capsys.readouterr()
        assert not out and (words in err if words else not err)


@pytest.mark.slow
def test_the_command_runs_every_step() -> None:
    done = CliRunner().invoke(app, ["warm-up"])
    assert done.exit_code == 0 and "kept for the next time" in done.output
