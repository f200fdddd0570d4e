"""The manifest of a results folder, run.toml: configuration, floor plans, models; what may be added to it."""

from __future__ import annotations

import dataclasses
import math
import os
import shlex
import tomllib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from layoutexplore.benchmark.config import BASELINE, BenchmarkConfig, settings
from layoutexplore.benchmark.plans import PlanEntry
from layoutexplore.benchmark.rows import knows_the_plan
from layoutexplore.errors import ConfigError, ResultsError, cause, checks_arguments
from layoutexplore.files import is_there, read_toml, to_toml
from layoutexplore.files.reading import shown_path
from layoutexplore.files.schema import Items, Number, Record, TableOf, Text
from layoutexplore.plugins.own_code import reference_in

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
        "baseline": Text(),
        "starts": Number(whole=True),
        "agents": Items(Text()),
        "sensors": Items(Text()),
        "plans": TableOf(Record({"content_hash": Text()}, {"raster_hash": Text()})),
        "settings": _SETTINGS,
    },
    {
        "command": Text(most=1_000_000),
        "commands": Items(Text(most=1_000_000)),
        "knows_the_plan": Items(Text()),
    },
)
"""What run.toml must hold."""

_ADVICE = (
    "put a copy of it back, or run the benchmark again with another --out, or with --force, which deletes "
    "all results in the folder"
)


@checks_arguments
def read_manifest(folder: str | os.PathLike[str]) -> dict[str, Any]:
    """What the run.toml of a folder says; all its `commands` stand in `command`, too, a line each.

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
        found = read_toml(path, _MANIFEST, limit="text_mb")  # it grows with the plans, unlike settings
    except ConfigError as error:
        reason = cause(error).removeprefix(str(path)).lstrip(": ")
        raise ResultsError(f"{path} is damaged or of another version ({reason}): {_ADVICE}") from error
    commands = found.get("commands", [found.get("command", "")])  # Earlier versions noted one.
    return found | {"commands": list(filter(None, commands)), "command": "\n".join(commands)}


@checks_arguments
def agents_that_know(manifest: Mapping[str, Any]) -> frozenset[str]:
    """The agents that are shown the floor plan, as was noted when they ran.

    Where nothing was noted they are made; one whose code is not found counts as one that does not know.
    """
    noted = manifest.get("knows_the_plan")
    return frozenset(filter(knows_the_plan, manifest["agents"]) if noted is None else noted)


@checks_arguments
def planned_runs(manifest: Mapping[str, Any]) -> int:
    """Number of runs that the floor plans, starts, sensors and agents of a folder make."""
    lists = (manifest[name] for name in ("plans", "sensors", "agents"))
    return int(manifest["starts"]) * math.prod(map(len, lists))


def changed_models(old: dict[str, Any], new: dict[str, Any]) -> list[str]:
    """The agents of two manifests whose weights or own code are not the same in both."""
    was, now = (manifest["settings"].get("models", {}) for manifest in (old, new))
    both = set(old["agents"]) & set(new["agents"])
    return sorted(agent for agent in both if was.get(agent) != now.get(agent))


def mixed_code(manifest: dict[str, Any]) -> list[str]:
    """What is to be said of results that come from several states of one file of a user's own."""
    states: dict[str, dict[str, list[str]]] = {}
    for agent, text in manifest["settings"].get("models", {}).items():
        reference = reference_in(agent) or reference_in(agent.partition("predictor=")[2])
        if reference:
            states.setdefault(reference.place, {}).setdefault(text.partition(" ")[0], []).append(agent)
    return [
        f"{place} has changed between these agents, whose results are not of the same code: "
        + "; ".join(" and ".join(agents) for agents in found.values())
        + " (--again AGENT makes the runs of one anew)"
        for place, found in states.items()
        if len(found) > 1
    ]


def manifest_of(
    config: BenchmarkConfig, plans: list[PlanEntry], models: dict[str, str], command: str
) -> dict[str, Any]:
    """What run.toml says of a benchmark with floor plans and fingerprints of models."""
    return {
        "commands": [command] if command else [],
        "config_hash": config.config_hash,
        "starts": config.starts,
        "baseline": config.baseline or BASELINE,
        "agents": sorted(config.agents),
        "sensors": sorted(config.sensors),
        "settings": settings(config) | {"models": models},
        "plans": {plan.name: dataclasses.asdict(plan) for plan in plans},
    }


def merge_manifests(
    old: dict[str, Any],
    new: dict[str, Any],
    path: Path,
    *,
    extend: bool,
    renewed: Collection[str] = frozenset(),
) -> dict[str, Any]:
    """What run.toml is to say now.

    Args:
        old: What it says.
        new: What this call would write into an empty folder.
        path: The folder.
        extend: Whether plans, starts, sensors and agents may be added or be left out.
        renewed: Agents of which no run counts, or none that is there: their code may be another.

    Raises:
        ResultsError: The results that are there are those of another configuration.
    """
    models = new["settings"]["models"]
    noted = old["settings"].get("models", {})  # Earlier versions did not note models.
    kept = {name: "not noted" for name in models if name in old["agents"]} | noted
    old["settings"]["models"] = {name: text for name, text in kept.items() if name not in renewed}
    for name, plan in old["plans"].items():
        if "raster_hash" not in plan and name in new["plans"]:  # Nor did they note this hash.
            plan["raster_hash"] = new["plans"][name]["raster_hash"]
    was, now = (dict(_flat(tomllib.loads(to_toml(_comparable(table))))) for table in (old, new))

    def grows(key: str) -> bool:
        added = key.startswith(("settings.lidars.", _MODELS, "plans.")) and (key not in was or key not in now)
        return added or key in ("agents", "sensors", "starts")

    changed = [k for k in sorted(was.keys() | now.keys()) if was.get(k) != now.get(k)]
    free = {_MODELS + name for name in renewed}
    fatal = [k for k in changed if k not in free and not (extend and grows(k))]
    if fatal:
        lines = [f"  {k}: {_shown(was.get(k))} there, {_shown(now.get(k))} now" for k in fatal[:8]]
        more = [f"  and {len(fatal) - 8} more"] if len(fatal) > 8 else []
        begin = f"{path} holds the results of another configuration:"
        raise ResultsError("\n".join([begin, *lines, *more, _what_to_do(path, fatal, grows)]))
    merged = {**old, **new}
    for name in ("agents", "sensors"):
        merged[name] = sorted({*old[name], *new[name]})
    merged["starts"] = max(old["starts"], new["starts"])
    merged["plans"] = {**old["plans"], **new["plans"]}
    for name in ("lidars", "models"):
        merged["settings"][name] = {**old["settings"][name], **new["settings"][name]}
    knowing = (agents_that_know(old) - set(new["agents"])) | set(new["knows_the_plan"])
    merged |= {"knows_the_plan": sorted(knowing)}
    merged["commands"] = list(dict.fromkeys([*old["commands"], *new["commands"]]))
    del merged["command"]
    return merged


_MODELS = "settings.models."


def _what_to_do(path: Path, fatal: list[str], grows: Callable[[str], bool]) -> str:
    """What may be done where results of another configuration are in the way."""
    ways = ["does so with --force"]
    if all(map(grows, fatal)):
        ways.append("adds to it with --extend")
    elif all(key.startswith(_MODELS) for key in fatal):
        options = " ".join(f"--again {shlex.quote(key.removeprefix(_MODELS))}" for key in fatal)
        ways.append(f"makes the runs of the changed agents alone anew with {options}")
    return (
        f"Choose another folder with --out, or delete {path} to start again; `layoutexplore benchmark` "
        f"{', and '.join(ways)}."
    )


def partly_again(agent: str, stale: Sequence[Path]) -> str:
    """What is said where an agent has changed and is not to make all its runs again: those would be lost."""
    names = ", ".join(f"{path.parent.name}/{path.stem}" for path in stale[:5])
    more = f" and {len(stale) - 5} more" if len(stale) > 5 else ""
    return (
        f"{agent} has changed, and this call makes only a part of its runs again; these would be lost: "
        f"{names}{more}. Give their plans, starts and sensors with --again, too, or choose another --out"
    )


_NOT_COMPARED = ("command", "commands", "config_hash", "baseline", "knows_the_plan")


def _comparable(manifest: dict[str, Any]) -> dict[str, Any]:
    kept = {k: v for k, v in manifest.items() if k not in _NOT_COMPARED}
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
