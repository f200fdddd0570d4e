"""The results folder: what is in it, how it survives being killed, and when it belongs to something else.

    run.toml          the configuration, the plans with their content hashes, the command
    results.csv       a row per finished run, appended as it ends, sorted when all are done (and
    results.parquet) runs/PLAN/*.npz   the coverage curve and the way walked of a run
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
import tomllib
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from layoutexplore.benchmark.config import BenchmarkConfig, settings
from layoutexplore.benchmark.counterfactual import LOG, Counterfactual, from_arrays, to_arrays
from layoutexplore.benchmark.episode import Row
from layoutexplore.benchmark.plans import PlanEntry
from layoutexplore.errors import ConfigError, ResultsError
from layoutexplore.files import (
    HALF,
    is_whole,
    read_arrays,
    read_toml,
    to_toml,
    write_arrays,
    write_atomically,
)
from layoutexplore.maps.raster import PlanRaster
from layoutexplore.simulation.episode import Episode

COLUMNS = tuple(f.name for f in dataclasses.fields(Row))

_REQUIRED = {f.name for f in dataclasses.fields(Row) if f.default is dataclasses.MISSING}

LOCK = ".lock"
"""File that is held while a benchmark writes."""


_MANIFEST: dict[type | tuple[type, ...], tuple[str, ...]] = {
    str: ("config_hash", "command", "baseline", "settings.version"),
    int: ("starts", "settings.seed"),
    list: ("agents", "sensors"),
    dict: ("plans", "settings.lidars"),
    (int, float): ("settings.simulation.turn_cost", "settings.simulation.coverage_goal"),
}
"""What run.toml must hold, by type."""

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

    def episode(self, row: Row) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
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

    def raster(self, name: str) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
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
        path = self.path / "run.toml"
        if not path.is_file():
            raise ResultsError(f"{self.path} holds no benchmark: there is no run.toml in it")
        try:
            manifest = read_toml(path)
        except ConfigError as error:
            raise ResultsError(f"{path} is damaged ({error}): start again with --force") from error
        lacking = [
            name
            for kind, names in _MANIFEST.items()
            for name in names
            if not isinstance(_at(manifest, name), kind)
        ]
        if not lacking:
            lacking = [
                f"plans.{name}"
                for name, plan in manifest["plans"].items()
                if _at(plan, "content_hash") is None
            ]
        if lacking:
            raise ResultsError(
                f"{self.path}/run.toml is damaged or of another version (no {lacking[0]}): start again "
                "with --force"
            )
        return manifest


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
    wanted = _manifest(config, plans, models, command)
    if force and (path / "run.toml").exists():
        for name in ("runs", "plans"):
            shutil.rmtree(path / name, ignore_errors=True)
        for name in ("results.csv", "results.parquet", "summary.csv", "report.html", "report.md", "run.toml"):
            (path / name).unlink(missing_ok=True)
    for half_written in path.rglob(f".*{HALF}"):
        half_written.unlink(missing_ok=True)
    if (path / "run.toml").exists():
        wanted = _merged(folder.manifest(), wanted, path, extend=extend)
    write_atomically(path / "run.toml", to_toml(wanted))
    return folder


def _at(table: Any, path: str) -> Any:
    """The value at a path like "settings.seed" of nested tables; None where there is none."""
    for key in path.split("."):
        table = table.get(key) if isinstance(table, dict) else None
    return table


def _manifest(
    config: BenchmarkConfig, plans: list[PlanEntry], models: dict[str, str], command: str
) -> dict[str, Any]:
    return {
        "command": command,
        "config_hash": config.config_hash,
        "starts": config.starts,
        "baseline": config.baseline,
        "agents": sorted(config.agents),
        "sensors": sorted(config.sensors),
        "settings": settings(config) | {"models": models},
        "plans": {plan.name: dataclasses.asdict(plan) for plan in plans},
    }


def _merged(old: dict[str, Any], new: dict[str, Any], path: Path, *, extend: bool) -> dict[str, Any]:
    """What run.toml is to say now, or why it cannot be."""
    models, noted = (
        new["settings"]["models"],
        old["settings"].get("models", {}),
    )  # Earlier versions did not note models.
    old["settings"]["models"] = {name: "not noted" for name in models if name in old["agents"]} | noted
    was, now = (
        dict(_flat(tomllib.loads(to_toml(_comparable(old))))),
        dict(_flat(tomllib.loads(to_toml(_comparable(new))))),
    )

    def grows(key: str) -> bool:
        added = key.startswith(("settings.lidars.", "settings.models.", "plans.")) and (
            key not in was or key not in now
        )
        return added or key in ("agents", "sensors", "starts")

    changed = [k for k in sorted(was.keys() | now.keys()) if was.get(k) != now.get(k)]
    fatal = [k for k in changed if not (extend and grows(k))]
    if fatal:
        lines = [f"  {k}: {_shown(was.get(k))} there, {_shown(now.get(k))} now" for k in fatal[:8]]
        more = [f"  and {len(fatal) - 8} more"] if len(fatal) > 8 else []
        advice = "--extend to add to it, " if all(map(grows, fatal)) else ""
        raise ResultsError(
            "\n".join([f"{path} holds the results of another configuration:", *lines, *more])
            + f"\nChoose another folder with --out, {advice}or --force to delete what is there and start "
            "again."
        )
    merged = {**old, **new}
    for name in ("agents", "sensors"):
        merged[name] = sorted({*old[name], *new[name]})
    merged["starts"] = max(old["starts"], new["starts"])
    merged["plans"] = {**old["plans"], **new["plans"]}
    for name in ("lidars", "models"):
        merged["settings"][name] = {**old["settings"][name], **new["settings"][name]}
    return merged


def _comparable(manifest: dict[str, Any]) -> dict[str, Any]:
    kept = {k: v for k, v in manifest.items() if k not in ("command", "config_hash", "baseline")}
    kept["plans"] = {name: plan["content_hash"] for name, plan in manifest["plans"].items()}
    return kept


def _flat(value: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _flat(inner, f"{prefix}.{key}" if prefix else key)
    else:
        yield prefix, value


def _shown(value: Any) -> str:
    text = (
        "nothing" if value is None else ", ".join(map(str, value)) if isinstance(value, list) else str(value)
    )
    return text if len(text) <= 60 else text[:57] + "..."


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
