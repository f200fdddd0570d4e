"""Fixed suites of cells: what everybody can compare on, told apart by a hash of floor plans and settings."""

from __future__ import annotations

import hashlib
import json
import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from layoutexplore.benchmark.config import BASELINE, BenchmarkConfig, read_benchmark_config
from layoutexplore.benchmark.manifest import manifest_of
from layoutexplore.benchmark.plans import PlanEntry, entry
from layoutexplore.errors import ConfigError, ResultsError, checks_arguments, unknown_name
from layoutexplore.files import naming, read_toml, to_toml
from layoutexplore.maps.library import find_plans

SUITES = {"v1": "fe1064b791c445c1"}
"""The hash of each suite that ships: of its file (`suite_v1.toml`) and of the contents of its floor plans."""

_DECIDED = ("plans", "starts", "sensors", "seed", "baseline", "simulation", "lidars", "poses")


@dataclass(frozen=True)
class Suite:
    """Cells that are fixed: floor plans, starts, sensors and how they are simulated.

    Attributes:
        name: Its name, or its file.
        options: Fields of `BenchmarkConfig`.
        definition: The same as its file says them.
        released: The hash that it was released with; empty for a file of your own.

    Example:
        >>> load_suite("v1").config(("tour",)).agents
        ('nearest', 'tour')
    """

    name: str
    options: Mapping[str, Any]
    definition: Mapping[str, Any]
    released: str = ""

    def config(self, agents: tuple[str, ...] = (), **given: Any) -> BenchmarkConfig:
        """The benchmark of some agents on the suite; its baseline runs, too.

        Args:
            agents: Strategies.
            given: Other fields of `BenchmarkConfig`; those that the suite decides are refused.

        Raises:
            ConfigError: A field is given that the suite decides.
        """
        if fixed := sorted(set(given) & set(_DECIDED)):
            raise ConfigError(
                f"suite {self.name} decides {', '.join(fixed)}: leave that out, or leave out --suite"
            )
        options = {"baseline": BASELINE, **self.options}
        everyone = agents if options["baseline"] in agents else (options["baseline"], *agents)
        return BenchmarkConfig(agents=everyone, **options, **given)

    @cached_property
    def plans(self) -> dict[str, PlanEntry]:
        """The floor plans by name; `MapError` where one is missing."""
        config = self.config()
        found = [entry(source, config.simulation) for source in find_plans(config.plans)]
        return {plan.name: plan for plan in found}

    @cached_property
    def hash(self) -> str:
        """16 hexadecimal digits of its definition and of the contents of its floor plans.

        Raises:
            ConfigError: They are not those that the suite was released with.
        """
        # What was released keeps its hash; the geometry alone tells its floor plans apart.
        contents = {
            name: plan.content_hash if self.released else plan.raster_hash
            for name, plan in self.plans.items()
        }
        text = json.dumps({"definition": self.definition, "plans": contents}, sort_keys=True)
        found = hashlib.sha256(text.encode()).hexdigest()[:16]
        if self.released and found != self.released:
            raise ConfigError(
                f"the floor plans that are installed make other cells ({found}) than suite {self.name} has "
                f"({self.released}): install layoutexplore as it was released"
            )
        return found

    @cached_property
    def cells(self) -> dict[str, Any]:
        """What decides the cells in this version of the package, as `cells_of` a run.toml."""
        manifest = manifest_of(self.config(), list(self.plans.values()), {}, "")
        return cells_of(tomllib.loads(to_toml(manifest)))


@checks_arguments
def load_suite(name: str | os.PathLike[str]) -> Suite:
    """A suite by its name, or from a TOML file of your own: that of a benchmark, without agents.

    Raises:
        UnknownNameError: No suite of that name.
        ConfigError: The file cannot be read, or decides what is no part of a suite.
    """
    name = os.fspath(name)
    if name in SUITES:
        path = Path(__file__).parent / f"suite_{name}.toml"
        return Suite(name, read_benchmark_config(path), read_toml(path), SUITES[name])
    if not name.endswith(".toml"):
        raise unknown_name("suite", name, list(SUITES))
    options = read_benchmark_config(Path(name))
    if other := sorted(set(options) - set(_DECIDED)):
        raise ConfigError(f"{name} is no suite: it decides {', '.join(other)}, which differ from run to run")
    found = Suite(name, options, read_toml(Path(name)))
    with naming(Path(name), ConfigError):
        found.config()
    return found


@checks_arguments
def cells_of(manifest: Mapping[str, Any]) -> dict[str, Any]:
    """What decides the cells of a benchmark, as its run.toml says: plans by content, starts, settings."""
    if missing := {"settings", "plans", "starts"} - set(manifest):
        raise ResultsError(f"a benchmark's run.toml says nothing of {', '.join(sorted(missing))}")
    settings = manifest["settings"]
    return {
        "plans": {name: plan["content_hash"] for name, plan in manifest["plans"].items()},
        "rooms of doors": {
            name: plan["raster_hash"] for name, plan in manifest["plans"].items() if "raster_hash" in plan
        },
        "starts": manifest["starts"],
        "seed": settings["seed"],
        "simulation": settings["simulation"],
        "lidars": settings["lidars"],
        "poses": settings.get("poses", {}),
    }
