"""The results folder: what is in it, how it survives being killed, and when it belongs to something else.

    run.toml          the configuration, the plans with their content hashes, the command
    results.csv       a row per finished run, appended as it ends, sorted when all are done
    results.parquet   the same as a binary table
    runs/PLAN/*.npz   the coverage curve and the track of a run
    plans/PLAN.npz    the plan's cells, for the pictures of the report

A run's curve is renamed into place before its row is appended in one write, so a killed benchmark loses only
the runs that were in flight; a row that was cut off half-way is dropped when the folder is opened again, and
so is what was half-written.
"""

from __future__ import annotations

import csv
import dataclasses
import fcntl
import io
import re
import shutil
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.counterfactual import LOG, Counterfactual, from_arrays, to_arrays
from layoutexplore.benchmark.manifest import manifest_of, merge_manifests, read_manifest
from layoutexplore.benchmark.plans import PlanEntry
from layoutexplore.benchmark.rows import Row
from layoutexplore.errors import ResultsError
from layoutexplore.files import HALF, is_whole, read_arrays, to_toml, write_arrays, write_atomically
from layoutexplore.grids.arrays import Floats, Mask
from layoutexplore.maps.raster import PlanRaster
from layoutexplore.simulation.episode import Episode

COLUMNS = tuple(f.name for f in dataclasses.fields(Row))

_REQUIRED = {f.name for f in dataclasses.fields(Row) if f.default is dataclasses.MISSING}

LOCK = ".lock"
"""File that is held while a benchmark writes."""


_CONVERTERS: dict[str, Callable[[str], Any]] = {
    "int": int,
    "float": float,
    "bool": lambda text: text == "True",
    "str": str,
}


class ResultsFolder:
    """A folder of results of one configuration.

    Args:
        path: The folder; made by `open_results`.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.table = path / "results.csv"

    def rows(self) -> list[Row]:
        """The rows of results.csv; columns that an earlier version did not write are empty.

        Raises:
            ResultsError: The file is missing or not one of ours.
        """
        try:
            text = self.table.read_text(encoding="utf-8")
        except OSError as error:
            raise ResultsError(f"cannot read {self.table}: {error.strerror}") from error
        except UnicodeDecodeError as error:
            raise ResultsError(f"{self.table} is no table of results: {error}") from error
        lines = list(csv.reader(io.StringIO(text)))
        if not lines or not _REQUIRED <= set(lines[0]) <= set(COLUMNS):
            raise ResultsError(
                f"{self.table} does not have the columns of this version: choose another --out, or --force"
            )
        try:
            return [parse_row(line, lines[0]) for line in lines[1:]]
        except (ValueError, KeyError) as error:
            raise ResultsError(
                f"{self.table} is damaged: {error}; remove the line, or start again with --force"
            ) from error

    def append(self, row: Row) -> None:
        """Add a row in a single write; `ResultsError` where that fails."""
        try:
            with self.table.open("ab", buffering=0) as file:
                file.write(format_row(row).encode())
        except OSError as error:
            raise ResultsError(f"cannot write {self.table}: {error.strerror}") from error

    def rewrite(self, rows: Iterable[Row]) -> None:
        """Replace all rows, sorted, at once."""
        ordered = sorted(rows, key=lambda row: row.key)
        write_atomically(self.table, _header() + "".join(map(format_row, ordered)))

    def finished(self) -> list[Row]:
        """Rows of earlier runs that ended well and whose curve is there, whole.

        The file is cut back to these.
        """
        if self.table.exists():
            written = self.table.read_bytes()
            if not written.endswith(b"\n"):
                write_atomically(self.table, written[: written.rfind(b"\n") + 1])
        rows = self.rows() if self.table.exists() and self.table.stat().st_size else []
        good = {row.key: row for row in rows if not row.error and is_whole(self.curve_path(row))}
        self.rewrite(good.values())
        return list(good.values())

    def curve_path(self, row: Row) -> Path:
        """Where the curve and track of a run lie."""
        return (
            self.path / "runs" / slug(row.plan) / f"{slug(row.sensor)}-start{row.start}-{slug(row.agent)}.npz"
        )

    def save_episode(self, row: Row, episode: Episode) -> None:
        """Write a run's curve float32 (n, 2), its track float32 (m, 3), and what the layout changed in it."""
        arrays = {"curve": episode.curve.astype(np.float32), "track": episode.track.astype(np.float32)}
        notes = to_arrays(episode.notes) if episode.notes else {}
        write_arrays(self.curve_path(row), {**arrays, **notes})

    def episode(self, row: Row) -> tuple[Floats, Floats]:
        """The curve (n, 2) and track (m, 3) of a run.

        Raises:
            ResultsError: Their file is missing or damaged.
        """
        data = self._arrays(self.curve_path(row), "curve", "track")
        return data["curve"].astype(np.float64), data["track"].astype(np.float64)

    def counterfactual(self, row: Row) -> Counterfactual | None:
        """What the layout changed in a run; None where nobody asked, or a version that noted other things."""
        data = self._arrays(self.curve_path(row))
        return from_arrays(data) if "log" in data and data["log"].shape[1] == len(LOG) else None

    def save_raster(self, name: str, raster: PlanRaster) -> None:
        """Keep a plan's cells for the pictures."""
        frame = np.array([raster.resolution, *raster.origin], np.float64)
        arrays = {"occupied": np.packbits(raster.occupied), "shape": np.array(raster.shape), "frame": frame}
        write_arrays(self.path / "plans" / f"{slug(name)}.npz", arrays)

    def raster(self, name: str) -> tuple[Mask, Floats]:
        """A plan's occupied cells bool (rows, cols), and (resolution, origin x, y, theta)."""
        data = self._arrays(self.path / "plans" / f"{slug(name)}.npz", "occupied", "shape", "frame")
        rows, cols = data["shape"]
        occupied = np.unpackbits(data["occupied"], count=rows * cols).reshape(rows, cols).astype(np.bool_)
        return occupied, data["frame"]

    @staticmethod
    def _arrays(path: Path, *names: str) -> dict[str, NDArray[Any]]:
        try:
            return read_arrays(path, *names)
        except ResultsError as error:
            raise ResultsError(f"{error}; the same benchmark command makes it anew") from error

    def manifest(self) -> dict[str, Any]:
        """What run.toml says.

        Raises:
            ResultsError: It is missing, cannot be read, or lacks what this version needs.
        """
        return read_manifest(self.path)


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold a results folder for one process; it is made where there is none.

    Raises:
        ResultsError: Another benchmark is writing there, or the path cannot be a results folder.
    """
    if path.exists() and not path.is_dir():
        raise ResultsError(f"{path} is a file: --out must name a folder")
    if (
        path.exists()
        and any(path.iterdir())
        and not any((path / name).exists() for name in ("run.toml", LOCK))
    ):
        raise ResultsError(f"{path} is not empty and holds no benchmark: choose another folder with --out")
    lock = path / LOCK
    try:
        path.mkdir(parents=True, exist_ok=True)
        held = lock.open("w")
    except OSError as error:
        raise ResultsError(
            f"cannot write into {path} ({error.strerror}): choose another folder with --out"
        ) from error
    with held:
        try:
            fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise ResultsError(
                f"another benchmark is writing into {path}: wait for it, or choose another --out"
            ) from error
        try:
            yield
        finally:
            lock.unlink(missing_ok=True)


def open_results(
    path: Path,
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
        ResultsError: The folder holds another configuration, or is damaged.
    """
    folder = ResultsFolder(path)
    wanted = manifest_of(config, plans, models, command)
    if force and (path / "run.toml").exists():
        for name in ("runs", "plans"):
            shutil.rmtree(path / name, ignore_errors=True)
        for name in ("results.csv", "results.parquet", "summary.csv", "report.html", "report.md", "run.toml"):
            (path / name).unlink(missing_ok=True)
    for half_written in path.rglob(f".*{HALF}"):
        half_written.unlink(missing_ok=True)
    if (path / "run.toml").exists():
        wanted = merge_manifests(folder.manifest(), wanted, path, extend=extend)
    write_atomically(path / "run.toml", to_toml(wanted))
    return folder


def slug(name: str) -> str:
    """A file name for any name; names that had to be changed stay apart by a checksum.

    Example:
        >>> slug("tour"), slug("office:12")
        ('tour', 'office_12-41d6e872')
    """
    plain = re.sub(r"[^A-Za-z0-9._-]+", "_", name)
    return name if plain == name and name not in (".", "..") else f"{plain}-{zlib.crc32(name.encode()):08x}"


def _header() -> str:
    return ",".join(COLUMNS) + "\n"


def format_row(row: Row) -> str:
    """A line of results.csv; NaN is an empty field."""
    out = io.StringIO()
    values = (getattr(row, name) for name in COLUMNS)
    csv.writer(out, lineterminator="\n").writerow(["" if value != value else value for value in values])
    return out.getvalue()


def parse_row(line: list[str], header: Sequence[str] = COLUMNS) -> Row:
    """The inverse of `format_row`; columns that the header does not name are empty.

    Raises:
        ValueError: A value is missing, or is none of its column.
    """
    if len(line) != len(header):
        raise ValueError(f"a row has {len(line)} values, not {len(header)}")
    values: dict[str, Any] = {}
    fields = {f.name: f for f in dataclasses.fields(Row)}
    for f, text in zip((fields[name] for name in header), line, strict=True):
        values[f.name] = float("nan") if f.type == "float" and not text else _CONVERTERS[str(f.type)](text)
    return Row(**values)
