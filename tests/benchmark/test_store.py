"""The results folder: foreign, damaged, shared, and read again as it was written."""

from __future__ import annotations

import dataclasses
import math
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.rows import COLUMNS, Row, format_row, parse_row
from layoutexplore.benchmark.runner import BenchmarkWatcher, run_benchmark
from layoutexplore.benchmark.store import KEPT, ResultsFolder, locked
from layoutexplore.errors import ResultsError
from layoutexplore.files import write_arrays
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.tracing import floorplan_from_ascii
from tests.benchmark.cases import timeless
from tests.plans import HOUSE


def test_a_foreign_folder_is_left_alone(config: BenchmarkConfig, tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("precious")
    for force in (False, True):
        with pytest.raises(ResultsError, match="holds no benchmark"):
            run_benchmark(config, tmp_path, force=force)
    with pytest.raises(ResultsError, match="is a file"):
        run_benchmark(config, tmp_path / "thesis.tex")
    assert (tmp_path / "thesis.tex").read_text() == "precious"


@pytest.mark.parametrize("name", ["9" * 5000, "a\0b"])
def test_a_folder_that_cannot_be_is_no_benchmark(name: str) -> None:
    with pytest.raises(ResultsError, match="holds no benchmark") as told:
        ResultsFolder(Path(name)).manifest()
    assert len(str(told.value)) < 1000


DAMAGES = [b"plan,start\n", ",".join(COLUMNS).encode() + b"\na,b\n", b"\xff\xfe\n"]


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_table_is_made_anew_from_its_runs(
    config: BenchmarkConfig, tmp_path: Path, damage: bytes
) -> None:
    before = run_benchmark(config, tmp_path / "out")
    (tmp_path / "out" / "results.csv").write_bytes(damage)
    again = run_benchmark(config, tmp_path / "out")
    assert again.ran == 0 and repr(again.rows) == repr(before.rows)
    assert (tmp_path / "out" / KEPT).read_bytes() == damage


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_table_that_is_none_is_told_where_no_run_is_left(
    config: BenchmarkConfig, tmp_path: Path, damage: bytes
) -> None:
    run_benchmark(dataclasses.replace(config, starts=1), tmp_path / "out")
    shutil.rmtree(tmp_path / "out" / "runs")
    (tmp_path / "out" / "results.csv").write_bytes(damage)
    with pytest.raises(ResultsError, match=r"results\.csv"):
        run_benchmark(dataclasses.replace(config, starts=1), tmp_path / "out")
    assert (tmp_path / "out" / "results.csv").read_bytes() == damage


def test_a_number_that_was_changed_is_taken_from_the_run(config: BenchmarkConfig, tmp_path: Path) -> None:
    before = run_benchmark(config, tmp_path / "out")
    table = before.folder.table
    row = before.rows[3]
    line = format_row(row)
    changed = line.replace(f",{row.distance},", f",{row.distance + 8},")
    assert changed != line
    table.write_text(table.read_text().replace(line, changed))
    said: list[str] = []
    again = run_benchmark(config, tmp_path / "out", watcher=BenchmarkWatcher(say=said.append))
    assert again.ran == 0 and repr(again.rows) == repr(before.rows)
    assert any("the row of" in text and "is damaged" in text for text in said)


def test_one_flipped_byte_in_a_run_is_named_and_run_again(config: BenchmarkConfig, tmp_path: Path) -> None:
    before = run_benchmark(config, tmp_path / "out")
    path = before.folder.curve_path(before.rows[0])
    whole = path.read_bytes()
    for place in range(0, len(whole), max(len(whole) // 7, 1)):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0x10]) + whole[place + 1 :])
        said: list[str] = []
        again = run_benchmark(config, tmp_path / "out", watcher=BenchmarkWatcher(say=said.append))
        assert again.ran == any(str(path) in text for text in said) <= 1
        assert timeless(again.rows) == timeless(before.rows)
        assert np.array_equal(
            again.folder.episode(again.rows[0])[0], before.folder.episode(before.rows[0])[0]
        )


def test_a_manifest_that_is_no_text_is_told(config: BenchmarkConfig, tmp_path: Path) -> None:
    run_benchmark(dataclasses.replace(config, starts=1), tmp_path / "out")
    (tmp_path / "out" / "run.toml").write_bytes(b"\xff\xfe\n")
    with pytest.raises(ResultsError, match=r"run\.toml is damaged.*0xff\): put a copy of it back"):
        run_benchmark(dataclasses.replace(config, starts=1), tmp_path / "out")


def test_a_manifest_of_tens_of_thousands_of_plans_is_read(config: BenchmarkConfig, tmp_path: Path) -> None:
    folder = run_benchmark(dataclasses.replace(config, starts=1), tmp_path / "out").folder
    before, path = folder.manifest(), folder.path / "run.toml"
    table = path.read_text().partition("[plans.cottage]\n")[2].partition("\n\n")[0]
    more = "".join(f"\n[plans.cottage-{k}]\n{table}\n" for k in range(20_000))
    path.write_text(path.read_text() + more)
    assert path.stat().st_size > 2e6
    assert folder.manifest()["plans"].items() > before["plans"].items()


def test_a_plan_whose_doors_lead_elsewhere_is_another_one(config: BenchmarkConfig, tmp_path: Path) -> None:
    """Its geometry is the same; results that do not note its other hash are added to as they are."""
    plan = tmp_path / "house.geojson"
    house = floorplan_from_ascii(HOUSE, name="house")
    save_plan(house, plan)
    config = dataclasses.replace(config, plans=(str(plan),), starts=1, agents=("nearest",))
    path = run_benchmark(config, tmp_path / "out").folder.path / "run.toml"
    lines = path.read_text().splitlines()
    path.write_text("\n".join(text for text in lines if not text.startswith("raster_hash")))
    assert run_benchmark(config, tmp_path / "out").ran == 0
    assert any(text.startswith("raster_hash") for text in path.read_text().splitlines())
    doors = tuple(dataclasses.replace(door, rooms=(0, 0)) for door in house.doors)
    save_plan(dataclasses.replace(house, doors=doors), plan)
    with pytest.raises(ResultsError, match=r"plans\.house\.raster_hash: .* there, .* now"):
        run_benchmark(config, tmp_path / "out")


@pytest.mark.parametrize("line", ["starts", "baseline", "content_hash", "turn_cost"])
def test_a_manifest_that_lacks_something_is_told(config: BenchmarkConfig, tmp_path: Path, line: str) -> None:
    folder = run_benchmark(dataclasses.replace(config, starts=1), tmp_path / "out").folder
    path = folder.path / "run.toml"
    kept = [text for text in path.read_text().splitlines() if not text.startswith(line)]
    path.write_text("\n".join(kept))
    with pytest.raises(ResultsError, match=r"run\.toml is damaged"):
        folder.manifest()


@pytest.mark.parametrize(
    ("line", "hostile", "said"),
    [
        ("range_noise_std = ", "range_noise_std = []", "range_noise_std must be a finite number"),
        ("commands = ", "commands = 5", "commands must be a list"),
        ("content_hash = ", "content_hash = []", "content_hash must be a text"),
    ],
)
def test_a_manifest_with_other_values_is_told(
    config: BenchmarkConfig, tmp_path: Path, line: str, hostile: str, said: str
) -> None:
    folder = run_benchmark(dataclasses.replace(config, starts=1), tmp_path / "out").folder
    path = folder.path / "run.toml"
    lines = [hostile if text.startswith(line) else text for text in path.read_text().splitlines()]
    path.write_text("\n".join(lines))
    with pytest.raises(ResultsError, match=said):
        folder.manifest()


def test_a_folder_called_half_written_and_a_run_without_a_track(
    config: BenchmarkConfig, tmp_path: Path
) -> None:
    outcome = run_benchmark(config, tmp_path)
    (tmp_path / ".notes.part").mkdir()
    assert run_benchmark(config, tmp_path).ran == 0
    path = outcome.folder.curve_path(outcome.rows[0])
    write_arrays(path, {**outcome.folder.run_arrays(path), "track": np.empty((0, 3), np.float32)})
    with pytest.raises(ResultsError, match="the track has no pose"):
        outcome.folder.episode(outcome.rows[0])


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


def test_a_system_without_fcntl_will_do() -> None:
    code = "import sys; sys.modules['fcntl'] = None; import layoutexplore.benchmark.runner"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
