"""`layoutexplore train` from the command line: a run, its resumption, and flags that cannot be."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("sb3_contrib")
pytest.importorskip("tensorboard")

from layoutexplore.agents.rl.hyperparameters import read_config
from layoutexplore.files import to_toml
from layoutexplore.files.locking import LOCK, held
from tests.agents.rl.cases import SMALL_SEARCH, write_config
from tests.cli.test_cli import run as run_cli


def test_train_resume_and_benchmark(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    config, out = str(write_config(tmp_path / "small.toml")), str(tmp_path / "run")
    assert run_cli(monkeypatch, "train", config, "--steps", "16", "--out", out, "--device", "cpu") == 0
    text = capsys.readouterr().out
    assert f"policy:{out}" in text and text.count("the first evaluation") == 1
    assert run_cli(monkeypatch, "train", config, "--out", out) == 2
    assert "add --resume" in capsys.readouterr().err
    assert run_cli(monkeypatch, "train", "--algorithm", "tour-search", "--out", out) == 2
    assert "add --resume" in capsys.readouterr().err
    assert run_cli(monkeypatch, "train", "--out", out, "--resume", "--steps", "32") == 0
    assert "32/32 steps" in capsys.readouterr().out
    assert read_config(Path(out, "config.toml")).steps == 32  # what a further --resume goes on to
    assert run_cli(monkeypatch, "train", "--out", out, "--curve") == 0
    head, _, *rows = capsys.readouterr().out.splitlines()
    assert "d95 / nearest" in head and [row.split()[1] for row in rows] == ["0", "16", "32"]
    arguments = (
        "benchmark",
        "--plans",
        "apartment-01",
        "--agents",
        "nearest",
        "--agents",
        f"policy:{out}",
        "--starts",
        "1",
    )
    assert run_cli(monkeypatch, *arguments, "--jobs", "1", "--out", str(tmp_path / "bench")) == 0
    assert "policy:" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--device", "tpu"), "auto, cpu or cuda"),
        (("--algorithm", "ppoo"), "did you mean 'ppo'"),
        (("--resume", "--seed", "3"), "leave out --seed"),
        (("--resume",), "leave out --resume to start one there"),
        (("--curve",), "no evaluations in"),
        (("--predictor", "lay"), "unknown predictor 'lay'"),
        (("--plans", "officee:3"), "officee"),
        (("--plans", "generated", "--plans", "train"), "'generated' stands alone"),
        (("--envs", "1000000", "--algorithm", "ppo"), "envs must be a whole number from 1 to 4096"),
        (("--steps", "1000000000000"), "steps must be a whole number from 1 to"),
    ],
)
def test_what_cannot_be(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    message: str,
) -> None:
    assert run_cli(monkeypatch, "train", *arguments, "--out", str(tmp_path / "run")) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


def test_two_trainings_do_not_write_into_one_folder_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each would append its explorations to the other's: none could go on from them."""
    (tmp_path / "small.toml").write_text(to_toml({**SMALL_SEARCH, "steps": 4}))
    out = tmp_path / "run"
    assert run_cli(monkeypatch, "train", str(tmp_path / "small.toml"), "--out", str(out)) == 0
    before = {path: path.read_bytes() for path in out.iterdir() if path.is_file()}
    going_on = ("train", "--out", str(out), "--resume", "--steps", "8")
    with held(out, "training"):
        assert run_cli(monkeypatch, *going_on) == 2
        assert "another training is writing into" in capsys.readouterr().err
        found = {path: path.read_bytes() for path in out.iterdir() if path.is_file() and path.name != LOCK}
        assert found == before
    assert run_cli(monkeypatch, *going_on) == 0
    assert not (out / LOCK).exists()


def test_a_search_from_the_command_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "small.toml").write_text(to_toml({**SMALL_SEARCH, "steps": 4}))
    out = str(tmp_path / "run")
    assert run_cli(monkeypatch, "train", str(tmp_path / "small.toml"), "--out", out) == 0
    assert f"policy:{out}" in capsys.readouterr().out
    assert run_cli(monkeypatch, "train", "--out", out, "--resume", "--steps", "8") == 0
    assert "8/8 steps" in capsys.readouterr().out
    assert read_config(Path(out, "config.toml")).steps == 8
    assert (
        run_cli(
            monkeypatch,
            "train",
            "--algorithm",
            "tour-search",
            "--envs",
            "3",
            "--out",
            str(tmp_path / "other"),
        )
        == 2
    )
    assert "'envs'" in capsys.readouterr().err
