"""The results folder: what is in it, how it survives being killed, and when it belongs to something else.

    run.toml          the configuration, the plans with their content hashes, the command
    results.csv       a row per finished run, appended as it ends, sorted when all are done
    results.parquet   the same as a binary table
    runs/PLAN/*.npz   the coverage curve and the track of a run, what the layout changed in it, its replay;
                      *.error.txt says what went wrong in one
    plans/PLAN.npz    the plan's cells, for the pictures of the report

A run's curve is renamed into place before its row is appended in one write, so a killed benchmark loses only
the runs that were in flight; a row that was cut off half-way is dropped when the folder is opened again, and
so is what was half-written.
"""

from __future__ import annotations

import contextlib
import dataclasses
import errno
import os
import re
import shutil
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.counterfactual import LOG, Counterfactual
from layoutexplore.benchmark.manifest import (
    changed_models,
    manifest_of,
    merge_manifests,
    partly_again,
    read_manifest,
)
from layoutexplore.benchmark.plans import PlanEntry, all_tasks
from layoutexplore.benchmark.recording import (
    RECORDED,
    Recording,
    from_arrays,
    recording_from_arrays,
    recording_to_arrays,
    to_arrays,
)
from layoutexplore.benchmark.rows import COLUMNS, Row, RunKey, format_row, knows_the_plan, parse_row
from layoutexplore.drawing.beliefs import SUFFIX
from layoutexplore.errors import ResultsError, cause, checks_calls
from layoutexplore.files import (
    ArrayRule,
    atomic,
    limits,
    parse_csv,
    read_arrays,
    read_text,
    remove_half_written,
    safe_name,
    to_toml,
    write_arrays,
    write_atomically,
)
from layoutexplore.files.locking import LOCK, held
from layoutexplore.grids.arrays import Floats, Mask, stored_places
from layoutexplore.maps.raster import PlanRaster
from layoutexplore.simulation.episode import Episode

_REQUIRED = {f.name for f in dataclasses.fields(Row) if f.default is dataclasses.MISSING}

_ANEW = "the same benchmark command makes it anew"

_LARGE = 1e9
_RUN = {
    "curve": ArrayRule(shape=("scans", 2), low=-_LARGE, high=_LARGE),
    "track": ArrayRule(shape=("poses", 3), low=-_LARGE, high=_LARGE),
    "row": ArrayRule(kinds="U", optional=True),
    "log": ArrayRule(shape=("decisions", "columns"), optional=True, finite=False),
}
"""What the file of a run must hold."""

_RASTER = {
    "occupied": ArrayRule(kinds="u", shape=("bytes",), high=255),
    "shape": ArrayRule(kinds="iu", shape=(2,), low=1, high=1e6),
    "frame": ArrayRule(shape=(4,), low=-_LARGE, high=_LARGE),
}

KEPT = "results.damaged.csv"
"""Name of a damaged table, which is kept beside the one that takes its place."""

_FILES = ("results.csv", "results.parquet", "summary.csv", "report.html", "report.md", KEPT, "run.toml")
"""What lies directly in the folder."""

_OF_PAPER = re.compile(r"(plans|behaviour|profiles|(ratios|coverage|stops|layout)-.+)\.(csv|tex|svg|pdf)")
"""Names of the files that `report --paper` writes."""


@checks_calls
class ResultsFolder:
    """A folder of results of one configuration.

    Args:
        path: The folder; made by `open_results`.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self.table = self.path / "results.csv"

    def __repr__(self) -> str:
        return f"ResultsFolder({str(self.path)!r})"

    def rows(self) -> list[Row]:
        """The rows of results.csv; columns that an earlier version did not write are empty.

        Raises:
            ResultsError: The file is missing or not one of ours.
        """
        lines = parse_csv(read_text(self.table, ResultsError, "table of results"), str(self.table))
        if not lines or not _REQUIRED <= set(lines[0]) <= set(COLUMNS) or len(set(lines[0])) < len(lines[0]):
            raise ResultsError(
                f"{self.table} does not have the columns of this version: choose another --out, or --force"
            )
        rows = []
        for number, line in enumerate(lines[1:], start=2):
            try:
                rows.append(parse_row(line, lines[0]))
            except ValueError as error:
                raise ResultsError(
                    f"{self.table} is damaged: row {number}: {cause(error)}; remove the row, {_ANEW}"
                ) from error
        return rows

    @contextlib.contextmanager
    def appending(self) -> Iterator[Callable[[Row], None]]:
        """Hold the table open, and give what adds a row to it in a single write.

        Raises:
            ResultsError: The table cannot be written, now or by what is given.
        """
        try:
            file = self.table.open("ab", buffering=0)
        except OSError as error:
            raise self._unwritable(error) from error

        def append(row: Row) -> None:
            try:
                line, begin = format_row(row).encode(), file.tell()
                if file.write(line) < len(line):  # a disk that is nearly full takes a part of it
                    file.truncate(begin)
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            except OSError as error:
                raise self._unwritable(error) from error

        with file:
            yield append

    def _unwritable(self, error: OSError) -> ResultsError:
        return ResultsError(f"cannot write {self.table}: {error.strerror}")

    def rewrite(self, rows: Iterable[Row]) -> None:
        """Replace all rows, sorted, at once."""
        ordered = sorted(rows, key=lambda row: row.key)
        with atomic(self.table) as path, path.open("w", encoding="utf-8", newline="") as file:
            file.write(",".join(COLUMNS) + "\n")
            file.writelines(map(format_row, ordered))  # not one text of them all: there may be many

    def curve_path(self, row: Row) -> Path:
        """Where the curve and track of a run lie."""
        return self._path_of(row.key)

    def _path_of(self, key: RunKey) -> Path:
        plan, start, sensor, agent = key
        name = f"{safe_name(sensor)}-start{start}-{safe_name(agent)}.npz"
        return self.path / "runs" / safe_name(plan) / name

    def save_episode(self, row: Row, episode: Episode, recording: Recording | None = None) -> None:
        """Write a run's curve float32 (n, 2), its track (m, 3), what the layout changed, a replay.

        The row is kept beside them: where results.csv is damaged, nothing is lost.
        """
        arrays = {"curve": episode.curve.astype(np.float32), "track": stored_places(episode.track)}
        notes = to_arrays(episode.notes) if episode.notes else {}
        replay = recording_to_arrays(recording) if recording else {}
        write_arrays(self.curve_path(row), {**arrays, **notes, **replay, "row": np.array(format_row(row))})
        self._failure_path(row).unlink(missing_ok=True)

    def save_failure(self, row: Row, text: str) -> None:
        """Write what went wrong in a run, at length."""
        write_atomically(self._failure_path(row), text)

    def failure(self, row: Row) -> str:
        """What `save_failure` wrote; empty where nothing is written."""
        path = self._failure_path(row)
        return read_text(path, ResultsError) if path.is_file() else ""

    def _failure_path(self, row: Row) -> Path:
        return self.curve_path(row).with_suffix(".error.txt")

    def runs_of(self, agent: str, apart: Collection[RunKey] = ()) -> list[Path]:
        """The files of an agent's runs that ended well, apart from some by their keys."""
        name = re.compile(rf".+-start\d+-{re.escape(safe_name(agent))}\.npz")
        others = set(map(self._path_of, apart))
        found = (path for path in (self.path / "runs").glob("*/*.npz") if name.fullmatch(path.name))
        return sorted(path for path in found if path not in others)

    def drop(self, keys: Collection[RunKey]) -> None:
        """Delete the runs with the keys; all others stay."""
        for path in map(self._path_of, keys):
            for file in (path, path.with_suffix(SUFFIX), path.with_suffix(".error.txt")):
                file.unlink(missing_ok=True)
        if keys and self.table.exists():
            with contextlib.suppress(ResultsError):  # rows of a damaged table count only with their files
                self.rewrite(row for row in self.rows() if row.key not in keys)

    def episode(self, row: Row) -> tuple[Floats, Floats]:
        """The curve (n, 2) and track (m, 3) of a run.

        Raises:
            ResultsError: Their file is missing or damaged.
        """
        data = self._arrays(path := self.curve_path(row), _RUN, "curve", "track")
        if not len(data["track"]):
            raise ResultsError(f"{path} is damaged: the track has no pose; {_ANEW}")
        return data["curve"].astype(np.float64), data["track"].astype(np.float64)

    def curve(self, row: Row) -> Floats:
        """The curve (n, 2) of a run; `ResultsError` as of `episode`."""
        return self._arrays(self.curve_path(row), _RUN, "curve")["curve"].astype(np.float64)

    def log(self, row: Row) -> Floats | None:
        """What the layout changed in a run, the log alone; None as of `counterfactual`."""
        if row.prediction_seconds == 0:  # no predictor was asked: nothing was noted
            return None
        log = self._arrays(self.curve_path(row), _RUN, "log").get("log")
        return None if log is None or log.shape[1] != len(LOG) else log

    def counterfactual(self, row: Row) -> Counterfactual | None:
        """What the layout changed in a run; None where nobody asked, or a version that noted other things."""
        path = self.curve_path(row)
        data = self._arrays(path, {"log": _RUN["log"]}, "log", "moment")
        return from_arrays(data, str(path)) if "log" in data and data["log"].shape[1] == len(LOG) else None

    def recording(self, row: Row) -> Recording | None:
        """The replay of a run; None where an earlier version noted none."""
        path = self.curve_path(row)
        data = self._arrays(path, {}, *RECORDED)
        return recording_from_arrays(data, str(path)) if data.keys() >= set(RECORDED) else None

    def raster_path(self, name: str) -> Path:
        """Where the cells of a plan lie."""
        return self.path / "plans" / f"{safe_name(name)}.npz"

    def save_raster(self, name: str, raster: PlanRaster) -> None:
        """Keep a plan's cells for the pictures."""
        frame = np.array([raster.resolution, *raster.origin], np.float64)
        arrays = {"occupied": np.packbits(raster.occupied), "shape": np.array(raster.shape), "frame": frame}
        write_arrays(self.raster_path(name), arrays)

    def raster(self, name: str) -> tuple[Mask, Floats]:
        """A plan's occupied cells bool (rows, cols), and (resolution, origin x, y, theta)."""
        path = self.raster_path(name)
        data = self._arrays(path, _RASTER)
        rows, cols = data["shape"].tolist()
        if rows * cols > limits().image_pixels or len(data["occupied"]) != -(-rows * cols // 8):
            raise ResultsError(f"{path} is damaged: {rows} x {cols} cells; {_ANEW}")
        occupied = np.unpackbits(data["occupied"], count=rows * cols).reshape(rows, cols).astype(np.bool_)
        return occupied, data["frame"]

    def run_arrays(self, path: str | os.PathLike[str]) -> dict[str, NDArray[Any]]:
        """What the file of a run holds: "curve", "track", "row", and what was noted of the layout.

        Raises:
            ResultsError: It is missing or damaged.
        """
        return self._arrays(Path(path), _RUN)

    @staticmethod
    def _arrays(path: Path, rules: Mapping[str, ArrayRule], *beginnings: str) -> dict[str, NDArray[Any]]:
        try:
            return read_arrays(path, rules=rules, beginnings=beginnings)
        except ResultsError as error:
            raise ResultsError(f"{error}; {_ANEW}") from error

    def manifest(self) -> dict[str, Any]:
        """What run.toml says.

        Raises:
            ResultsError: It is missing, cannot be read, or lacks what this version needs.
        """
        return read_manifest(self.path)


@contextlib.contextmanager
def locked(path: str | os.PathLike[str]) -> Iterator[None]:
    """Hold a results folder for one process; it is made where there is none.

    Raises:
        ResultsError: Another benchmark is writing there, or the path cannot be a results folder.
    """
    path = Path(path)
    if path.exists() and not path.is_dir():
        raise ResultsError(f"{path} is a file: --out must name a folder")
    ours = any((path / name).exists() for name in ("run.toml", LOCK))
    if path.exists() and any(path.iterdir()) and not ours:
        raise ResultsError(f"{path} is not empty and holds no benchmark: choose another folder with --out")
    with held(path, "benchmark"):
        yield


def open_results(
    path: str | os.PathLike[str],
    config: BenchmarkConfig,
    plans: list[PlanEntry],
    models: dict[str, str],
    *,
    force: bool,
    extend: bool,
    command: str,
) -> ResultsFolder:
    """Begin in a results folder that is `locked`, or continue one that holds the same configuration.

    Args:
        path: The folder.
        config: What will run.
        plans: Its floor plans.
        models: Fingerprints of what agents have learnt.
        force: Delete the results of another benchmark that lie there.
        extend: Allow other plans, agents, sensors and more starts beside those that are there.
        command: Noted in run.toml.

    Raises:
        ResultsError: The folder holds another configuration, is damaged, or holds runs of an agent that has
            changed that are not to be made again.
    """
    folder, path = ResultsFolder(path), Path(path)
    wanted = manifest_of(config, plans, models, command)
    wanted["knows_the_plan"] = sorted(filter(knows_the_plan, config.agents))
    if force and (path / "run.toml").exists():
        _clear(path)
    remove_half_written(path, deep=True)
    if (path / "run.toml").exists():
        old = folder.manifest()
        changed = changed_models(old, wanted)
        failed = {a for a in changed if not folder.runs_of(a)}
        if not config.baseline:
            wanted["baseline"] = old["baseline"]
        renewed = {*config.again, *failed}
        wanted = merge_manifests(old, wanted, path, extend=extend, renewed=renewed)
        keys = {task.key for task in all_tasks(config, plans) if task.agent in renewed}
        for agent in changed:
            if agent in config.again and (stale := folder.runs_of(agent, apart=keys)):
                raise ResultsError(partly_again(agent, stale))
        folder.drop(keys)  # before it is noted that they come from other code
    write_atomically(path / "run.toml", to_toml(wanted))
    return folder


def _clear(path: Path) -> None:
    """Delete what a benchmark, its report and its paper have left in a folder; what else is there stays."""
    for name in ("runs", "plans"):
        shutil.rmtree(path / name, ignore_errors=True)
    for name in _FILES:
        (path / name).unlink(missing_ok=True)
    if (paper := path / "paper").is_dir():
        for file in paper.iterdir():
            if _OF_PAPER.fullmatch(file.name):
                file.unlink(missing_ok=True)
        with contextlib.suppress(OSError):
            paper.rmdir()
