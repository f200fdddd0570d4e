"""The results folder: foreign, damaged, shared, and read again as it was written."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.rows import Row
from layoutexplore.benchmark.runner import run_benchmark
from layoutexplore.benchmark.store import COLUMNS, format_row, locked, parse_row, slug
from layoutexplore.errors import ResultsError


def test_a_foreign_folder_is_left_alone(config: BenchmarkConfig, tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("precious")
    for force in (False, True):
        with pytest.raises(ResultsError, match="holds no benchmark"):
            run_benchmark(config, tmp_path, force=force)
    with pytest.raises(ResultsError, match="is a file"):
        run_benchmark(config, tmp_path / "thesis.tex")
    assert (tmp_path / "thesis.tex").read_text() == "precious"


@pytest.mark.parametrize(
    ("damage", "said"), [("plan,start\n", "columns"), (",".join(COLUMNS) + "\na,b\n", "damaged")]
)
def test_a_damaged_table_is_told(config: BenchmarkConfig, tmp_path: Path, damage: str, said: str) -> None:
    run_benchmark(dataclasses.replace(config, starts=1), tmp_path / "out")
    (tmp_path / "out" / "results.csv").write_text(damage)
    with pytest.raises(ResultsError, match=said):
        run_benchmark(dataclasses.replace(config, starts=1), tmp_path / "out")


@pytest.mark.parametrize(("name", "said"), [("results.csv", "no table of results"), ("run.toml", "damaged")])
def test_a_file_that_is_no_text_is_told(
    config: BenchmarkConfig, tmp_path: Path, name: str, said: str
) -> None:
    run_benchmark(dataclasses.replace(config, starts=1), tmp_path / "out")
    (tmp_path / "out" / name).write_bytes(b"\xff\xfe\n")
    with pytest.raises(ResultsError, match=said):
        run_benchmark(dataclasses.replace(config, starts=1), tmp_path / "out")


@pytest.mark.parametrize("line", ["starts", "baseline", "content_hash", "turn_cost"])
def test_a_manifest_that_lacks_something_is_told(config: BenchmarkConfig, tmp_path: Path, line: str) -> None:
    folder = run_benchmark(dataclasses.replace(config, starts=1), tmp_path / "out").folder
    path = folder.path / "run.toml"
    kept = [text for text in path.read_text().splitlines() if not text.startswith(line)]
    path.write_text("\n".join(kept))
    with pytest.raises(ResultsError, match=r"run\.toml is damaged"):
        folder.manifest()


def test_two_benchmarks_do_not_share_a_folder(config: BenchmarkConfig, tmp_path: Path) -> None:
    with locked(tmp_path / "out"), pytest.raises(ResultsError, match="another benchmark is writing"):
        run_benchmark(config, tmp_path / "out", force=True)
    assert run_benchmark(config, tmp_path / "out").ran == 16


names = st.text(min_size=1, max_size=12).filter(
    lambda text: "\r" not in text and "\n" not in text and "\0" not in text
)


metres = st.floats(0, 1e5).map(lambda x: round(x, 6)) | st.just(math.nan)


@given(names, names, st.integers(0, 99), metres, st.booleans())
def test_rows_survive_the_file(plan: str, error: str, start: int, d95: float, reached: bool) -> None:
    import csv
    import io

    row = Row(
        plan=plan,
        start=start,
        sensor="stage",
        agent="tour:a=1,b=2",
        seed=0,
        d95=d95,
        reached95=reached,
        error=error,
    )
    (line,) = csv.reader(io.StringIO(format_row(row)))
    assert repr(parse_row(line)) == repr(row)


@given(st.lists(names, min_size=2, max_size=2, unique=True))
def test_slugs_are_file_names_and_stay_apart(pair: list[str]) -> None:
    a, b = map(slug, pair)
    assert a != b and "/" not in a and a not in (".", "..")
