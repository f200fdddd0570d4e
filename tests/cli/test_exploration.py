"""`layoutexplore explore`: regions, ways back, runs that pause and go on."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from layoutexplore import cli
from layoutexplore.errors import MapWarning, ResultsError
from layoutexplore.files.locking import LOCK, held
from layoutexplore.maps import expand_plans
from layoutexplore.maps.geojson import save_plan
from layoutexplore.simulation.saved_run import read_saved_run
from tests.plans import offices

RUNNER = CliRunner(env={"COLUMNS": "120", "TERM": "dumb"})


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("plans") / "offices.geojson"
    save_plan(offices(), path)
    return str(path)


def explore(*arguments: str) -> list[str]:
    result = RUNNER.invoke(cli.app, ["explore", *arguments])
    assert result.exit_code == 0, result.output
    return result.output.splitlines()


def line(lines: list[str], name: str) -> str:
    return next(text.removeprefix(name).strip() for text in lines if text.startswith(name))


def test_a_run_pauses_and_goes_on(plan: str, tmp_path: Path) -> None:
    state, options = tmp_path / "run.npz", ["--agent", "random", "--sensor", "indoor", "--seed", "4"]
    whole = explore(plan, *options, "--out", str(tmp_path / "whole"))
    first = explore(plan, *options, "--pause-after", "15", "--save-state", str(state))
    assert "paused" in line(first, "ended by") and f"wrote {state}" in first
    assert read_saved_run(state).notes == {"agent": "random"}
    second = explore(plan, "--continue", str(state), "--out", str(tmp_path / "rest"))
    for name in ("floor plan", "agent, sensor", "ended by", "seen", "travelled", "99 % seen after", "scans"):
        assert line(second, name) == line(whole, name)
    for name in ("map.pgm", "track.csv", "curve.csv"):
        assert (tmp_path / "whole" / name).read_bytes() == (tmp_path / "rest" / name).read_bytes()


def test_options_that_a_run_that_goes_on_does_not_heed_are_told(plan: str, tmp_path: Path) -> None:
    state = tmp_path / "run.npz"
    explore(plan, "--sensor", "indoor", "--pause-after", "5", "--save-state", str(state))
    goes_on = (plan, "--continue", str(state), "--pause-after", "9")
    assert "not heeded" not in "".join(explore(*goes_on, "--sensor", "indoor", "--agent", "nearest"))
    told = explore(*goes_on, "--agent", "tour", "--sensor", "indoor", "--seed", "0", "--noise", "low")
    assert (
        "--agent, --noise not heeded: the run goes on as it was saved, with nearest, seed 0 and indoor"
        in told
    )
    assert line(told, "agent, sensor") == "nearest, indoor"


def test_a_run_that_goes_on_with_other_code_says_so(plan: str, tmp_path: Path) -> None:
    code, state = tmp_path / "mine.py", tmp_path / "run.npz"
    text = "class Mine:\n    def reset(self, seed): ...\n    def act(self, decision): return 0\n"
    code.write_text(text)
    explore(plan, "--agent", f"{code}:Mine", "--pause-after", "5", "--save-state", str(state))
    goes_on = (plan, "--continue", str(state), "--pause-after", "9")
    assert "has changed" not in "".join(explore(*goes_on))
    code.write_text(text.replace("return 0", "return len(decision.frontiers) - 1"))
    told = explore(*goes_on, "--save-state", str(state))
    assert f"{code}:Mine: its code, or what it has learnt from, has changed since" in " ".join(told)
    assert "has changed" not in "".join(explore(*goes_on)), "it was saved anew with the code as it is"


def test_a_robot_explores_a_region_and_returns(plan: str, tmp_path: Path) -> None:
    options = [plan, "--sensor", "indoor", "--region", "0,0 9,0 9,8 0,8"]
    stays, returns = explore(*options), explore(*options, "--return", "--out", str(tmp_path / "run"))
    assert "arrived" in line(returns, "way back") and not any("way back" in text for text in stays)
    assert [line(stays, n) for n in ("travelled", "99 % seen after")] == [
        line(returns, n) for n in ("travelled", "99 % seen after")
    ]
    assert line(stays, "ended by").startswith("coverage: as much was seen")
    x, y, _ = (tmp_path / "run" / "track.csv").read_text().splitlines()[1].split(",")
    last = (tmp_path / "run" / "track.csv").read_text().splitlines()[-1].split(",")
    assert abs(float(x) - float(last[0])) < 0.2 and abs(float(y) - float(last[1])) < 0.2


def test_a_folder_holds_the_pictures_of_one_run(plan: str, tmp_path: Path) -> None:
    folder, state, options = tmp_path / "run", tmp_path / "run.npz", ["--sensor", "indoor"]
    own = folder / "rooms_030.geojson"
    explore(plan, *options, "--agent", "layout-tour", "--out", str(folder))
    assert list(folder.glob("rooms_*.geojson"))
    own.write_text("somebody's own")
    written = explore(plan, *options, "--out", str(folder), "--pause-after", "9", "--save-state", str(state))
    assert list(folder.glob("rooms_*.geojson")) == [own]
    assert {path for path in folder.glob("seen_*.png") if f"wrote {path}" not in written} == set()
    before = set(folder.iterdir())
    explore(plan, "--continue", str(state), "--out", str(folder))
    assert before < set(folder.iterdir()), "a run that goes on keeps the pictures of its beginning"


def test_two_runs_do_not_write_into_one_folder_at_once(plan: str, tmp_path: Path) -> None:
    command = ["explore", plan, "--sensor", "indoor", "--out", str(tmp_path)]
    with held(tmp_path, "run"):
        result = RUNNER.invoke(cli.app, command)
        assert isinstance(result.exception, ResultsError) and "another run is writing" in str(
            result.exception
        )
        assert [path.name for path in tmp_path.iterdir()] == [LOCK]
    assert RUNNER.invoke(cli.app, command).exit_code == 0
    assert (tmp_path / "map.yaml").exists() and not (tmp_path / LOCK).exists()


def test_a_run_that_goes_on_draws_what_an_unbroken_one_draws(plan: str, tmp_path: Path) -> None:
    whole, parts, state = tmp_path / "whole", tmp_path / "parts", tmp_path / "run.npz"
    explore(plan, "--sensor", "indoor", "--out", str(whole))
    begins = ["--sensor", "indoor", "--save-state", str(state), "--out", str(parts)]
    seen = line(explore(plan, *begins, "--pause-after", "9"), "seen")
    assert float(seen.split()[0]) % 25 > 0, "it pauses within a quarter"
    goes_on = ["--continue", str(state), "--save-state", str(state), "--out", str(parts)]
    first, again = explore(plan, *goes_on), explore(plan, *goes_on)
    for picture in sorted(whole.glob("seen_*.png")):
        assert (parts / picture.name).read_bytes() == picture.read_bytes(), picture.name
    assert "ms each" in line(first, "decisions") and "ms each" not in line(again, "decisions")


def test_a_run_is_not_written_over_rooms_that_it_reads(plan: str, tmp_path: Path) -> None:
    explore(plan, "--sensor", "indoor", "--agent", "layout-tour", "--out", str(tmp_path))
    # In a folder of floor plans, they and the pictures are none; the map is one, as far as it goes.
    with pytest.warns(MapWarning, match=r"map\.yaml: is the map of a run"):
        assert expand_plans(tmp_path) == [str(tmp_path / "map.yaml")]
    rooms = tmp_path / "rooms_100.geojson"
    result = RUNNER.invoke(cli.app, ["explore", str(rooms), "--agent", "layout-tour", "--out", str(tmp_path)])
    assert "rooms_100.geojson is read and would be written over" in str(result.exception)
