"""The manifest of a results folder, run.toml: configuration, floor plans, models; what may be added to it."""

from __future__ import annotations

import dataclasses
import os
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from layoutexplore.benchmark.config import BenchmarkConfig, settings
from layoutexplore.benchmark.plans import PlanEntry
from layoutexplore.errors import ConfigError, ResultsError, cause, checks_arguments
from layoutexplore.files import is_there, read_toml, to_toml
from layoutexplore.files.reading import shown_path
from layoutexplore.files.schema import Items, Number, Record, TableOf, Text

_SETTINGS = Record(
    {
        "version": Text(),
        "seed": Number(whole=True),
        "lidars": TableOf(Record({"range_noise_std": Number(), "dropout": Number()})),
        "simulation": Record(
            {"turn_cost": Number(), "coverage_goal": Number()}, {"odometry_noise": TableOf(Number())}
        ),
    },
    {"models": TableOf(Text())},
)
_MANIFEST = Record(
    {
        "config_hash": Text(),
        "command": Text(most=1_000_000),
        "baseline": Text(),
        "starts": Number(whole=True),
        "agents": Items(Text()),
        "sensors": Items(Text()),
        "plans": TableOf(Record({"content_hash": Text()}, {"raster_hash": Text()})),
        "settings": _SETTINGS,
    }
)
"""What run.toml must hold."""

_ADVICE = (
    "put a copy of it back, or run the benchmark again with another --out, or with --force, which deletes "
    "all results in the folder"
)


@checks_arguments
def read_manifest(folder: str | os.PathLike[str]) -> dict[str, Any]:
    """What the run.toml of a folder says.

    Raises:
        ResultsError: It is missing, cannot be read, or lacks what this version needs.
    """
    folder = Path(folder)
    path = folder / "run.toml"
    if not is_there(path) or not path.is_file():
        raise ResultsError(
            f"{shown_path(folder)} holds no benchmark: there is no run.toml in it; name the folder of one, "
            "or make it with `layoutexplore benchmark --out FOLDER`"
        )
    try:
        return read_toml(path, _MANIFEST, limit="text_mb")  # it grows with the plans, unlike settings
    except ConfigError as error:
        reason = cause(error).removeprefix(str(path)).lstrip(": ")
        raise ResultsError(f"{path} is damaged or of another version ({reason}): {_ADVICE}") from error


def manifest_of(
    config: BenchmarkConfig, plans: list[PlanEntry], models: dict[str, str], command: str
) -> dict[str, Any]:
    """What run.toml says of a benchmark with floor plans and fingerprints of models."""
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


def merge_manifests(old: dict[str, Any], new: dict[str, Any], path: Path, *, extend: bool) -> dict[str, Any]:
    """What run.toml is to say now, or why it cannot be."""
    models = new["settings"]["models"]
    noted = old["settings"].get("models", {})  # Earlier versions did not note models.
    old["settings"]["models"] = {name: "not noted" for name in models if name in old["agents"]} | noted
    for name, plan in old["plans"].items():
        if "raster_hash" not in plan and name in new["plans"]:  # Nor did they note this hash.
            plan["raster_hash"] = new["plans"][name]["raster_hash"]
    was, now = (dict(_flat(tomllib.loads(to_toml(_comparable(table))))) for table in (old, new))

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
    hashes = "content_hash", "raster_hash"
    kept["plans"] = {name: {key: plan.get(key) for key in hashes} for name, plan in manifest["plans"].items()}
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
