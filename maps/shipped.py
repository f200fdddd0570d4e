"""The floor plans that ship: which seeds, which parameters, which split; and the command that writes them.

`python -m layoutexplore.maps.shipped` writes the files of `maps/plans` anew: one GeoJSON a plan, and
`splits.json`. Every plan is a building of its own, so that no building falls into two splits; `quick`
repeats some names as a small benchmark suite.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from layoutexplore.errors import checks_arguments
from layoutexplore.files import write_json
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.generator.generate import generate
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.library import PLAN_FOLDER

SPLITS = ("train", "validation", "test")


@dataclass(frozen=True)
class Shipped:
    """A plan that ships: family and number make its name; seed and parameters make the plan; `area` in m2."""

    family: str
    number: int
    split: str
    seed: int
    area: float
    parameters: Mapping[str, Any] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """FAMILY-NN, also the name of the building."""
        return f"{self.family}-{self.number:02d}"

    def draw(self) -> FloorPlan:
        """The plan, generated."""
        plan = generate(self.family, self.seed, area=self.area, **self.parameters)
        return replace(plan, name=self.name, building=self.name)


FURNISHED = {"clutter": 0.14}
CROWDED = {"clutter": 0.24}
SOME_SHUT = {"closed_doors": 0.2}

SHIPPED = (
    Shipped("office", 1, "train", 111, 420.0),
    Shipped("office", 2, "train", 102, 1150.0, FURNISHED),
    Shipped("office", 3, "validation", 103, 760.0),
    Shipped("office", 4, "test", 104, 620.0),
    Shipped("office", 5, "test", 105, 2100.0, SOME_SHUT),
    Shipped("school", 1, "train", 112, 900.0),
    Shipped("school", 2, "train", 102, 1800.0),
    Shipped("school", 3, "validation", 103, 1300.0, FURNISHED),
    Shipped("school", 4, "validation", 104, 1600.0, FURNISHED),
    Shipped("school", 5, "test", 116, 3900.0),
    Shipped("apartment", 1, "train", 101, 150.0, FURNISHED),
    Shipped("apartment", 2, "train", 102, 460.0),
    Shipped("apartment", 3, "test", 113, 240.0, CROWDED),
    Shipped("hospital", 1, "train", 101, 900.0),
    Shipped("hospital", 2, "train", 102, 2400.0, SOME_SHUT),
    Shipped("hospital", 3, "test", 103, 1500.0, FURNISHED),
    Shipped("hall", 1, "train", 113, 560.0),
    Shipped("hall", 2, "train", 102, 1500.0, FURNISHED),
    Shipped("hall", 3, "test", 103, 820.0),
    Shipped("angled", 1, "train", 111, 650.0),
    Shipped("angled", 2, "validation", 102, 1200.0, SOME_SHUT),
    Shipped("angled", 3, "test", 114, 950.0),
    Shipped("curved", 1, "train", 101, 520.0),
    Shipped("curved", 2, "test", 102, 1100.0),
)

QUICK = ("office-04", "apartment-03", "hall-03", "angled-03", "curved-02")
"""The small benchmark suite: five families, 200 to 1100 m2, of the split test, which no shipped model saw."""


def shipped_splits() -> dict[str, list[str]]:
    """Names of the plans of every split, and of the quick suite."""
    table = {split: [plan.name for plan in SHIPPED if plan.split == split] for split in SPLITS}
    return {**table, "quick": list(QUICK)}


@checks_arguments
def write_shipped(folder: Path = PLAN_FOLDER) -> list[Path]:
    """Write all plans and the splits into a folder; returns the files."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for shipped in SHIPPED:
        files.append(folder / f"{shipped.name}.geojson")
        save_plan(shipped.draw(), files[-1])
    files.append(folder / "splits.json")
    write_json(files[-1], shipped_splits(), indent=2)
    return files


if __name__ == "__main__":
    for file in write_shipped():
        print(file)
