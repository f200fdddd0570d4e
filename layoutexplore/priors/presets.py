"""Prior plans for studies, made from the plan of a run: true, rough, wrong and the like, by name and seed."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from layoutexplore.errors import ConfigError, MapError, MapWarning, unknown_name
from layoutexplore.files.reading import fingerprint, is_file, is_there
from layoutexplore.grids.arrays import Floats
from layoutexplore.layout.blueprint import has_ocr
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.library import find_plans, load_plan, plan_names, source_files
from layoutexplore.priors.evacuation_picture import PictureStyle, draw_evacuation_plan, picture_points
from layoutexplore.priors.plan import PriorPlan, plan_of_nothing, with_doors_to_all, with_expected_scale
from layoutexplore.priors.reading import prior_of_picture
from layoutexplore.priors.spoiling import SpoilConfig, SpoiledPlan, spoil

PRESETS: dict[str, SpoilConfig] = {
    "true": SpoilConfig(turned=True, skew=5.0),
    "rough": SpoilConfig(
        scale=0.10,
        aspect=0.10,
        stretch=0.03,
        merged=0.05,
        split=0.05,
        moved=0.05,
        missing=0.05,
        doors_missing=1 / 3,
        turned=True,
    ),
    "corridors": SpoilConfig(corridors_only=True, turned=True, skew=5.0),
    "other-floor": SpoilConfig(turned=True, skew=5.0),
    "wrong": SpoilConfig(turned=True, skew=5.0),
    "mirrored": SpoilConfig(mirrored=True, turned=True, skew=5.0),
    "empty": SpoilConfig(),
}
"""What is wrong in each; "rough" is drawn as an evacuation plan and read from the picture."""

OF_OTHERS = ("other-floor", "wrong")
"""Presets that show another floor than that of the run."""

SCALES = (0.5, 2.0)
"""A study's plan forgets its scale: its lengths are multiplied by a factor between these."""


@dataclass(frozen=True, eq=False)
class StudyPrior:
    """A prior plan with what a study knows of it.

    Attributes:
        prior: The plan.
        place: From true points float64 (n, 2) in metres to points of the plan; None where no place is right.
        changed: Ids of the true rooms that are drawn otherwise than they are.
    """

    prior: PriorPlan
    place: Callable[[Floats], Floats] | None = None
    changed: frozenset[int] = frozenset()


def study_prior(kind: str, plan: FloorPlan, seed: int, *, among: str = "") -> StudyPrior:
    """A prior plan of a run, by the name of a preset; its scale, rotation and position are not told.

    Args:
        kind: A name of `PRESETS`.
        plan: The plan of the run.
        seed: Of the run.
        among: Folder, split or names (joined by "+") with other floors ("other-floor") and other buildings
            ("wrong"); those that ship for training when empty.

    Raises:
        UnknownNameError: There is no such preset.
        ConfigError: No other floor, or no other building, is known.
        MapError: A plan cannot be read.
    """
    if kind not in PRESETS:
        raise unknown_name("prior plan", kind, PRESETS)
    rng = np.random.default_rng([seed, int(plan.content_hash[:8], 16), sorted(PRESETS).index(kind)])
    if kind == "empty":
        return StudyPrior(plan_of_nothing("empty", cells=100, resolution=0.1))
    shown = plan if kind not in OF_OTHERS else _other(kind, plan, rng, among)
    spoiled = spoil(shown, PRESETS[kind], rng)
    made = _from_picture(spoiled, rng) if kind == "rough" else _unscaled(kind, spoiled, rng)
    return made if shown is plan else StudyPrior(made.prior)


def made_from(kind: str, among: str) -> str:
    """What a preset depends on beside the plan of the run: other floors, or whether words are read; or "".

    Args:
        kind: A name of `PRESETS`.
        among: As of `study_prior`; errors, too.
    """
    if kind == "rough":
        return "ocr" if has_ocr() else ""
    return digest_of_others(among) if kind in OF_OTHERS else ""


def digest_of_others(among: str) -> str:
    """Changes with the files that `OF_OTHERS` choose from; empty where none is named.

    Args:
        among: As of `study_prior`; errors, too.
    """
    files = [file for source in _sources(among) for file in source_files(source) if is_file(file)]
    with suppress(OSError):  # one that cannot be read is not chosen
        return fingerprint(files) if files else ""
    return ""


def _sources(among: str) -> tuple[str, ...]:
    return tuple(find_plans(among.split("+")) if among else plan_names("train"))


def _unscaled(kind: str, spoiled: SpoiledPlan, rng: np.random.Generator) -> StudyPrior:
    """The plan at a scale that follows from its doors and rooms alone."""
    factor = math.exp(rng.uniform(*np.log(SCALES)))
    raw = PriorPlan(
        name=kind, free=spoiled.free, room_ids=spoiled.room_ids, resolution=spoiled.resolution * factor
    )
    prior = with_doors_to_all(with_expected_scale(raw))
    unit = prior.resolution / spoiled.resolution
    return StudyPrior(prior, lambda points: spoiled.distortion.forward(points) * unit, spoiled.changed)


def _from_picture(spoiled: SpoiledPlan, rng: np.random.Generator) -> StudyPrior:
    """The plan as it is read from the picture of an evacuation plan."""
    style = PictureStyle()
    image = draw_evacuation_plan(spoiled.free, spoiled.room_ids, spoiled.resolution, rng, style=style)
    try:
        with warnings.catch_warnings():  # a study would say in each run that there is no Tesseract
            warnings.simplefilter("ignore", MapWarning)
            read = prior_of_picture(image, name="rough")
    except MapError as error:
        return StudyPrior(plan_of_nothing("rough", f"its picture cannot be read: {error}"))
    height = max(1, round(spoiled.free.shape[0] * style.pixels_per_metre * spoiled.resolution))
    left, bottom = read.corner

    def place(points: Floats) -> Floats:
        pixels = picture_points(spoiled.distortion.forward(points), height, style)
        up = np.stack([pixels[:, 0] - left, bottom - pixels[:, 1]], axis=1)
        return np.asarray(up * read.pixels)

    return StudyPrior(read.prior, place, spoiled.changed)


def _other(kind: str, plan: FloorPlan, rng: np.random.Generator, among: str) -> FloorPlan:
    """Another floor of the building, or one of another building that is about as large."""
    sources = _sources(among)
    others = []
    for source, name, building, area in _index(sources):
        same = building == plan.building
        if name != plan.name and same == (kind == "other-floor"):
            others.append((source, abs(math.log(area / max(plan.area, 1.0)))))
    if not others:
        what = "other floor of building" if kind == "other-floor" else "building other than"
        raise ConfigError(
            f"prior:{kind}: no {what} {plan.building} is known; name a folder with among=FOLDER"
        )
    near = sorted(others, key=lambda item: item[1])[: 1 if kind == "other-floor" else 5]
    return load_plan(near[rng.integers(len(near))][0])


@cache
def _index(sources: tuple[str, ...]) -> tuple[tuple[str, str, str, float], ...]:
    """Source, name, building and area of plans; those that cannot be read are left out."""
    found = []
    for source in sources:
        try:
            plan = load_plan(Path(source) if is_there(Path(source)) else source)
        except MapError:
            continue
        found.append((source, plan.name, plan.building, max(plan.area, 1.0)))
    return tuple(found)
