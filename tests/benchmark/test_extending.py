"""Results that are added to, made anew in part, or thrown away: what belongs to others stays."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest
from typer.testing import CliRunner

from layoutexplore.benchmark import rows
from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.manifest import agents_that_know
from layoutexplore.benchmark.runner import BenchmarkWatcher, run_benchmark
from layoutexplore.benchmark.store import KEPT, ResultsFolder
from layoutexplore.cli import app
from layoutexplore.errors import ResultsError, UnknownNameError
from layoutexplore.files import to_toml
from tests.benchmark.cases import timeless
from tests.plugins.cases import AGENT, write

BROKEN = AGENT.replace("return min(", "raise RuntimeError('broken')\n        return min(")
CHANGED = AGENT.replace("STEP = 0", "STEP = 1")


def config(plans: Path, *agents: str) -> BenchmarkConfig:
    return BenchmarkConfig(
        plans=(str(plans / "cottage.geojson"),), starts=1, agents=("nearest", *agents), explain=False
    )


def contents(folder: Path) -> dict[Path, bytes]:
    """Every file of the runs, and when it was written does not count."""
    return {path: path.read_bytes() for path in (folder / "runs").rglob("*") if path.is_file()}


def test_failed_runs_that_are_not_asked_for_stay(plans: Path, tmp_path: Path) -> None:
    broken = f"{write(tmp_path, BROKEN)}:Mine"
    run_benchmark(config(plans, broken), tmp_path / "out")
    done = run_benchmark(config(plans, "random"), tmp_path / "out", extend=True)
    (failed,) = (row for row in done.rows if row.error)
    assert done.ran == 1 and failed.agent == broken and done.folder.failure(failed)
    assert not done.failed, "that was another call"
    assert repr(ResultsFolder(tmp_path / "out").rows()) == repr(done.rows)
    assert [row.agent for row in done.asked] == ["nearest", "random"]
    assert run_benchmark(config(plans, broken), tmp_path / "out", extend=True).ran == 1


def test_a_bug_of_an_agent_that_never_ended_well_may_be_fixed(plans: Path, tmp_path: Path) -> None:
    mine = f"{write(tmp_path, BROKEN)}:Mine"
    before = run_benchmark(config(plans, mine), tmp_path / "out")
    write(tmp_path)
    after = run_benchmark(config(plans, mine), tmp_path / "out")
    assert after.ran == 1 and not after.failed and before.rows[1] == after.rows[1]
    write(tmp_path, CHANGED)
    with pytest.raises(ResultsError, match="holds the results of another configuration"):
        run_benchmark(config(plans, mine), tmp_path / "out")


def test_the_runs_of_one_agent_are_made_again(plans: Path, tmp_path: Path) -> None:
    one, two = (f"{write(tmp_path, AGENT, name)}:Mine" for name in ("one.py", "two.py"))
    variant = f"{one}:skip=1"
    wanted = config(plans, one, two, variant)
    run_benchmark(wanted, tmp_path / "out")
    before = contents(tmp_path / "out")
    write(tmp_path, CHANGED, "one.py")
    with pytest.raises(ResultsError) as told:
        run_benchmark(wanted, tmp_path / "out")
    assert f"--again {one} --again {variant}" in str(told.value)
    with pytest.raises(ResultsError, match=r"skip=1.* there, .* now"):
        run_benchmark(dataclasses.replace(wanted, again=(one,)), tmp_path / "out")
    assert contents(tmp_path / "out") == before
    done = run_benchmark(dataclasses.replace(wanted, again=(one, variant)), tmp_path / "out")
    assert done.ran == 2 and len(done.rows) == 4 and not done.failed
    after = contents(tmp_path / "out")
    assert {path.name for path in before if before[path] == after[path]} == {
        done.folder.curve_path(row).name for row in done.rows if row.agent in ("nearest", two)
    }
    assert run_benchmark(wanted, tmp_path / "out").ran == 0
    with pytest.raises(UnknownNameError, match="agent of this benchmark"):
        dataclasses.replace(wanted, again=("tour",))


def test_runs_that_are_not_made_again_stay(plans: Path, tmp_path: Path) -> None:
    """On another plan: as they are, or with an error where the agent has changed."""
    mine, out = f"{write(tmp_path)}:Mine", tmp_path / "out"
    both = dataclasses.replace(config(plans, mine), plans=(str(plans),))
    before = run_benchmark(both, out)
    part = dataclasses.replace(config(plans, mine), again=(mine,))
    done = run_benchmark(part, out, extend=True)
    assert done.ran == 1 and timeless(done.rows) == timeless(before.rows)
    assert run_benchmark(both, out).ran == 0
    write(tmp_path, CHANGED)
    kept = contents(out), (out / "results.csv").read_bytes(), (out / "run.toml").read_bytes()
    with pytest.raises(ResultsError, match="would be lost: house/stage-start0-"):
        run_benchmark(part, out, extend=True)
    assert kept == (contents(out), (out / "results.csv").read_bytes(), (out / "run.toml").read_bytes())
    assert run_benchmark(dataclasses.replace(both, again=(mine,)), out).ran == 2


def test_runs_whose_file_is_gone_are_told(plans: Path, tmp_path: Path) -> None:
    """Those that are asked for are made anew; the others leave the table, of which a copy stays."""
    both, out = dataclasses.replace(config(plans), plans=(str(plans),)), tmp_path / "out"
    before = run_benchmark(both, out)
    table = before.folder.table.read_bytes()
    for row in before.rows:
        before.folder.curve_path(row).unlink()
    said: list[str] = []
    done = run_benchmark(config(plans), out, extend=True, watcher=BenchmarkWatcher(say=said.append))
    assert done.ran == 1 and [row.plan for row in done.rows] == ["cottage"]
    assert any(text.startswith("made anew") and "cottage, start 0, stage, nearest" in text for text in said)
    assert any("left out of results.csv" in text and "house, start 0" in text for text in said)
    assert (out / KEPT).read_bytes() == table
    again = run_benchmark(both, out, watcher=BenchmarkWatcher(say=said.append))
    assert again.ran == 1 and timeless(again.rows) == timeless(before.rows)


def test_failures_elsewhere_of_an_agent_that_is_mended_stay(plans: Path, tmp_path: Path) -> None:
    mine, out = f"{write(tmp_path, BROKEN)}:Mine", tmp_path / "out"
    run_benchmark(dataclasses.replace(config(plans, mine), plans=(str(plans),)), out)
    write(tmp_path)
    done = run_benchmark(config(plans, mine), out, extend=True)
    (failed,) = (row for row in done.rows if row.error)
    assert done.ran == 1 and failed.plan == "house" and done.folder.failure(failed)


def test_the_command_takes_agents_again(plans: Path, tmp_path: Path) -> None:
    words = ["benchmark", "--plans", str(plans / "cottage.geojson"), "--starts", "1", "--jobs", "1"]
    words += ["--agents", "nearest", "--agents", "random", "--out", str(tmp_path / "out")]
    for more, ran in (([], 2), ([], 0), (["--again", "random"], 1)):
        result = CliRunner().invoke(app, [*words, *more])
        assert result.exit_code == 0 and f"2 runs, {ran} of them now" in result.output, result.output


@pytest.mark.parametrize("noted", [True, False])
def test_an_agent_that_knows_the_plan_is_noted(plans: Path, tmp_path: Path, noted: bool) -> None:
    text = AGENT.replace("    def __init__", "    predictor = 'oracle'\n\n    def __init__")
    knows = f"{write(tmp_path, text)}:Mine"
    folder = run_benchmark(config(plans, knows), tmp_path / "out").folder
    if not noted:  # as an earlier version left it
        manifest = {k: v for k, v in folder.manifest().items() if k != "knows_the_plan"}
        (folder.path / "run.toml").write_text(to_toml(manifest))
    run_benchmark(config(plans, "clairvoyant"), tmp_path / "out", extend=True)
    (tmp_path / "mine.py").unlink()
    assert not rows.knows_the_plan(knows)
    assert agents_that_know(folder.manifest()) == {knows, "clairvoyant"}


def test_two_states_of_one_file_are_told(plans: Path, tmp_path: Path) -> None:
    mine = f"{write(tmp_path)}:Mine"
    said: list[str] = []
    watcher = BenchmarkWatcher(say=said.append)
    run_benchmark(config(plans, mine, f"{mine}:skip=1"), tmp_path / "out", watcher=watcher)
    assert not any("has changed" in text for text in said)
    write(tmp_path, CHANGED)
    run_benchmark(config(plans, f"{mine}:skip=2"), tmp_path / "out", extend=True, watcher=watcher)
    (told,) = (text for text in said if "has changed" in text)
    assert f"{mine} and {mine}:skip=1; {mine}:skip=2" in told


def test_commands_and_the_baseline_are_kept(plans: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    first = dataclasses.replace(config(plans, "random"), baseline="random")
    folder = run_benchmark(first, out, command="one").folder
    run_benchmark(first, out, command="one")
    run_benchmark(config(plans, "tour"), out, extend=True, command="two")
    manifest = folder.manifest()
    assert manifest["commands"] == ["one", "two"] and manifest["command"] == "one\ntwo"
    assert manifest["baseline"] == "random"
    run_benchmark(dataclasses.replace(first, baseline="nearest"), out, extend=True)
    assert folder.manifest()["baseline"] == "nearest" and folder.manifest()["commands"] == ["one", "two"]


def test_one_command_of_an_earlier_version_is_read(plans: Path, tmp_path: Path) -> None:
    folder = run_benchmark(config(plans), tmp_path / "out").folder
    manifest = folder.manifest() | {"command": "one"}
    del manifest["commands"]
    (folder.path / "run.toml").write_text(to_toml(manifest))
    assert folder.manifest()["commands"] == ["one"]
    run_benchmark(config(plans, "random"), tmp_path / "out", extend=True, command="two")
    assert folder.manifest()["commands"] == ["one", "two"]


def test_force_deletes_what_belongs_to_the_results_alone(plans: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    run_benchmark(config(plans), out)
    (out / "paper").mkdir()
    gone = ("ratios-stage.csv", "ratios-stage.tex", "coverage-stage.svg", "profiles.pdf", "plans.tex")
    for name in (*gone, "thesis.tex"):
        (out / "paper" / name).touch()
    (out / KEPT).touch()
    run_benchmark(config(plans), out, force=True)
    assert [path.name for path in (out / "paper").iterdir()] == ["thesis.tex"] and not (out / KEPT).exists()
    (out / "paper" / "thesis.tex").rename(out / "paper" / "plans.csv")
    run_benchmark(config(plans), out, force=True)
    assert not (out / "paper").exists()


def test_what_was_believed_of_a_plan_is_no_damaged_run(plans: Path, tmp_path: Path) -> None:
    wanted = config(plans, "plan-tour:predictor=prior:true")
    before = run_benchmark(wanted, tmp_path / "out")
    assert list((tmp_path / "out").rglob("*.prior.npz"))
    before.folder.table.unlink()
    said: list[str] = []
    again = run_benchmark(wanted, tmp_path / "out", watcher=BenchmarkWatcher(say=said.append))
    assert again.ran == 0 and repr(again.rows) == repr(before.rows)
    assert not any("prior.npz" in text for text in said)


def test_evaluations_share_a_folder_of_runs(plans: Path, tmp_path: Path) -> None:
    words = ["evaluate", "foresight", str(plans / "cottage.geojson"), "--out", str(tmp_path / "out")]
    words += ["--sensor", "stage", "--jobs", "1", "--predictor"]
    for predictor in ("oracle:horizon=0", "oracle:horizon=1"):
        result = CliRunner().invoke(app, [*words, predictor])
        assert result.exit_code == 0, result.output
        lines = (tmp_path / "out" / "foresight.md").read_text().splitlines()
        assert [line for line in lines if "`" in line] == [line for line in lines if f"`{predictor}`" in line]
    assert len(ResultsFolder(tmp_path / "out" / "runs").rows()) == 3
