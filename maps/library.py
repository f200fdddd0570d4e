"""Finding and loading floor plans: the ones that ship, generated ones, and files of every known format.

The plans that ship lie in `plans/`, one GeoJSON each, and `plans/splits.json` lists the names of each split:
"train", "validation" and "test" share no building, "quick" is the small suite of the benchmark.
"""

from __future__ import annotations

import functools
import os
import re
import sys
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import cache
from itertools import islice
from pathlib import Path

from shapely.errors import GEOSException

from layoutexplore.errors import MapError, MapWarning, cause, checks_arguments, counted, unknown_name
from layoutexplore.files import is_there, naming, read_json
from layoutexplore.files.limits import VARIABLE, limits
from layoutexplore.files.reading import is_file, shown_path
from layoutexplore.files.run_folders import QUARTERLY_NAMES, RUN_MAP, WHAT_A_RUN_SAW, is_of_run
from layoutexplore.files.schema import Items, TableOf, Text
from layoutexplore.grids.grid import check_resolution
from layoutexplore.grids.ros_map import IMAGE_SUFFIXES, YAML_SUFFIXES, images_of
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.formats.building_files import building_format, floors_of, split_level
from layoutexplore.maps.formats.foreign_geojson import has_areas, load_foreign_geojson
from layoutexplore.maps.geojson import is_own_format, load_geojson
from layoutexplore.maps.houseexpo import SIDECARS, load_houseexpo, with_sidecars
from layoutexplore.maps.image import LABELS_ENDING, load_image, rooms_beside, said_scale
from layoutexplore.maps.kth import images_of_floor, load_kth
from layoutexplore.maps.school_xml import load_school_xml
from layoutexplore.options import check_kind

PLAN_FOLDER = Path(__file__).parent / "plans"
SUFFIXES = (".geojson", ".json", ".xml", ".osm", ".ifc", *YAML_SUFFIXES, *IMAGE_SUFFIXES)

_SPLITS = TableOf(Items(Text()))

OWN_SCALE = "brings its own scale: --resolution and --scale-by are for images and drawings without one"

MOST_SEEDS = 100_000
"""So many generated floor plans FAMILY:FIRST-LAST may name."""

_SEEDS = re.compile(r"([a-z_]+):(\d+)(?:-(\d+))?")


@checks_arguments
def load_plan(
    path_or_name: str | os.PathLike[str],
    *,
    resolution: float | None = None,
    columns: Mapping[str, str] | None = None,
) -> FloorPlan:
    """A floor plan by the name of a shipped one, as "FAMILY:SEED" of the generator, or from a file.

    Args:
        path_or_name: Name, FAMILY:SEED, or the path of our GeoJSON, a school XML, a KTH ID_occ.png, a
            HouseExpo JSON, a ROS map's YAML or a plain image; or FILE#LEVEL, a floor of an IMDF folder, an
            OpenStreetMap file, an Open-RMF building or an IFC model.
        resolution: Metres a pixel of a plain image (0.05 is assumed when None), or a unit of a drawing (1
            when None). Maps of robots and of KTH bring their own.
        columns: Names of properties in a GeoJSON of another program, as for `load_foreign_geojson`.

    Raises:
        UnknownNameError: No plan of that name; the closest ones are suggested.
        MapError: The file is missing, broken, of no known format, or brings a scale and one is given; or
            several floor plans are named (a split, FAMILY:FIRST-LAST).
    """
    if resolution is not None:
        check_resolution(resolution)
    check_kind("a floor plan", path_or_name, str, os.PathLike)
    text = os.fspath(path_or_name)
    if text in plan_names():
        return load_geojson(PLAN_FOLDER / f"{text}.geojson")
    match = _SEEDS.fullmatch(text)
    if match and match[3] is None:
        from layoutexplore.maps.generator import generate

        return generate(match[1], int(match[2]))
    if match or text in splits():
        raise _several(text)
    path, level = split_level(text)
    if not is_there(path):
        raise _missing(text)
    known = building_format(path)
    if level and not known:
        raise MapError(f"{path}: has one floor only, so that #{level} names none")
    if path.is_dir() and not known:
        raise MapError(f"{path}: is a folder; name one of the floor plans inside it")
    try:
        with naming(path, MapError, lambda: source_files(text)):
            if known:
                plan = _stretched(known.load(path, level), resolution)
            else:
                plan = _loader(path, resolution, columns)(path)
            return replace(plan, file=shown_path(Path(text)))
    except GEOSException as error:
        raise MapError(
            f"{text}: its outlines cannot be put together: {cause(error)}; look for points that are "
            "nearly the same, and outlines that touch themselves"
        ) from error


def _stretched(plan: FloorPlan, metres: float | None) -> FloorPlan:
    """A plan whose unit is so many metres."""
    if metres is None:
        return plan
    said = {"scale": said_scale(metres, "unit")}
    return replace(plan.stretched(metres, metres), metadata={**plan.metadata, **said})


def _loader(
    path: Path, resolution: float | None, columns: Mapping[str, str] | None
) -> Callable[[Path], FloorPlan]:
    """The reader for a file, recognised by its ending and, for JSON, by what is inside."""
    suffix = path.suffix.lower()
    if suffix == ".xml":
        return lambda path: _stretched(load_school_xml(path), resolution)
    if suffix in (".geojson", ".json"):
        return _json_loader(path, resolution, columns)
    is_kth = suffix in IMAGE_SUFFIXES and _is_kth(path)
    if resolution is not None and (is_kth or suffix in YAML_SUFFIXES):
        raise MapError(f"{path}: {OWN_SCALE}")
    if is_kth:
        return load_kth
    if suffix in (*IMAGE_SUFFIXES, *YAML_SUFFIXES):
        return lambda path: load_image(path, resolution=resolution)
    raise MapError(
        f"{path}: no known format of floor plans; known endings: {', '.join(SUFFIXES)}; of a PDF, a drawing "
        "(DXF, DWG, SVG) or a picture of another kind, a PNG can be read, of an archive what is packed in it"
    )


@checks_arguments
def shows_rooms(source: str | os.PathLike[str]) -> bool:
    """Whether a file tells of rooms, itself or by another beside it; a map or a picture alone does not."""
    path, _ = split_level(os.fspath(source))
    if building_format(path):
        return True
    if path.suffix.lower() not in (*IMAGE_SUFFIXES, *YAML_SUFFIXES):
        return True
    return _is_kth(path) or rooms_beside(path) is not None or path.stem.endswith(LABELS_ENDING)


@checks_arguments
def source_files(source: str | os.PathLike[str]) -> tuple[Path, ...]:
    """The files that a floor plan, a map or a picture is read from; none of a name.

    Of a ROS map its image too, and of all that an image of rooms or a file of rooms and doors lies beside.
    """
    text = os.fspath(source)
    if text in plan_names() or _SEEDS.fullmatch(text):
        return ()
    path, _ = split_level(text)
    if is_there(path) and path.is_dir():
        return tuple(sorted(path.glob("*.geojson")))
    if not path.name:
        return ()
    found, suffix = [path], path.suffix.lower()
    if suffix in YAML_SUFFIXES:
        found += images_of(path)
    if suffix in (*YAML_SUFFIXES, *IMAGE_SUFFIXES):
        found += [beside for beside in [rooms_beside(path)] if beside]
        if suffix in IMAGE_SUFFIXES and _is_kth(path):
            found += images_of_floor(path)
    if suffix == ".json":
        found += with_sidecars(path)
    return tuple(dict.fromkeys(found))


def _is_json_plan(path: Path) -> bool:
    """Whether a JSON file is a FeatureCollection or a floor of HouseExpo."""
    try:
        data = read_json(path)
    except MapError:
        return False
    return isinstance(data, dict) and (data.get("type") == "FeatureCollection" or "verts" in data)


def _json_loader(
    path: Path, resolution: float | None, columns: Mapping[str, str] | None
) -> Callable[[Path], FloorPlan]:
    """The reader for a JSON file, which is parsed here: large ones take seconds."""
    data = read_json(path)
    is_collection = isinstance(data, dict) and data.get("type") == "FeatureCollection"
    if path.suffix.lower() == ".json" and not is_collection:
        if not (path.stem.endswith(SIDECARS) or (isinstance(data, dict) and "verts" in data)):
            raise MapError(
                f"{path}: is no floor plan: JSON is read as a GeoJSON FeatureCollection, or as a plan of "
                "HouseExpo (with its contour, verts); of Overpass save GeoJSON, or XML as .osm"
            )
        return lambda path: _stretched(load_houseexpo(path), resolution)
    if columns or not is_own_format(data):
        return functools.partial(load_foreign_geojson, columns=columns, data=data, unit=resolution)
    return lambda path: _stretched(load_geojson(path, data), resolution)


def _is_kth(path: Path) -> bool:
    return path.stem.endswith(("_occ", "_rooms")) and all(map(is_file, images_of_floor(path)))


def _several(text: str) -> MapError:
    """The error for the name of a split or a range of seeds where one floor plan is meant."""
    names = expand_plans(text)
    what = f"a {'split' if text in splits() else 'range'} of {counted(len(names), 'floor plan')}"
    return MapError(f"{text}: is {what}: name one of them, as {', '.join(names[:3])}")


def _missing(text: str) -> Exception:
    """The error for something that is neither a name nor a file."""
    if "/" in text or "\\" in text or split_level(text)[0].suffix.lower() in SUFFIXES:
        return MapError(f"{shown_path(Path(text))}: there is no such file")
    from layoutexplore.maps.generator import FAMILIES

    return unknown_name("plan", text, [*plan_names(), *splits(), *(f"{family}:SEED" for family in FAMILIES)])


@cache
def splits() -> dict[str, tuple[str, ...]]:
    """Names of the shipped plans of every split."""
    index = PLAN_FOLDER / "splits.json"
    if not index.is_file():
        return {}
    return {split: tuple(names) for split, names in read_json(index, _SPLITS).items()}


@cache
def _all_names() -> tuple[str, ...]:
    return tuple(sorted(path.stem for path in PLAN_FOLDER.glob("*.geojson")))


@checks_arguments
def plan_names(split: str | None = None) -> list[str]:
    """Names of the floor plans that ship, of one split or all.

    Raises:
        UnknownNameError: There is no such split.
    """
    if split is None:
        return list(_all_names())
    if split not in splits():
        raise unknown_name("split", split, splits())
    return list(splits()[split])


@checks_arguments
def expand_plans(spec: str | os.PathLike[str]) -> list[str]:
    """What `load_plan` can read, for one word of a command line.

    Args:
        spec: The name of a plan or a split, FAMILY:SEED, FAMILY:FIRST-LAST, a file, or a folder (with all
            inside it).

    Raises:
        UnknownNameError: No plan, split or family of that name.
        MapError: No such file, or a folder without floor plans.

    Warns:
        MapWarning: A file of a folder is left out (a GeoJSON without areas or a floor), or the map of a run.
    """
    check_kind("a floor plan", spec, str, os.PathLike)
    text = os.fspath(spec)
    if text in splits():
        return plan_names(text)
    if text in plan_names():
        return [text]
    if match := _SEEDS.fullmatch(text):
        return _expand_seeds(match[1], int(match[2]), int(match[3] or match[2]))
    path, level = split_level(text)
    if not is_there(path):
        raise _missing(text)
    if building_format(path):
        return [text] if level else floors_of(path) or [text]  # who loads one without floors says so
    if path.is_dir():
        if found := _plans_in(path):
            return found
        raise MapError(f"{path}: no floor plan inside this folder")
    return [text]


def _plans_in(folder: Path) -> list[str]:
    """The floor plans of a folder, every floor of those that hold several."""
    found = []
    for path in _files_in(folder):
        plans, why_none = list[str](), ""
        if building_format(path):
            plans, why_none = floors_of(path), "no floor is in it"
        elif building_format(path.parent) is None and _is_plan(path):
            plans = [] if _is_without_areas(path) else [str(path)]
            why_none = "its features are lines or points, so that it is no floor plan"
        said = WHAT_A_RUN_SAW if path.name == RUN_MAP and is_of_run(path) else ""
        if said := f"left out: {why_none}" if why_none and not plans else said:
            warnings.warn(f"{path}: {said}", MapWarning, stacklevel=4)
        found += plans
    return found


def _files_in(folder: Path) -> list[Path]:
    """All that lies in a folder, sorted, unless it is so much that the folder is another one than meant."""
    most = limits().files
    try:
        found = list(islice(folder.rglob("*"), int(min(most, sys.maxsize)) + 1))
    except OSError as error:  # a folder that vanishes meanwhile
        raise MapError(f"{shown_path(folder)}: cannot be searched: {error.strerror or error}") from error
    if len(found) > most:
        raise MapError(
            f"{shown_path(folder)}: holds more than {most:g} files and folders, the limit files: name a "
            f"folder of floor plans, or raise the limit with {VARIABLE}"
        )
    return sorted(found)


def _is_without_areas(path: Path) -> bool:
    """Whether a file is a GeoJSON of another program of lines and points only: paths to walk, perhaps."""
    if path.suffix.lower() != ".geojson":
        return False
    try:
        data = read_json(path)
    except MapError:
        return False  # Who loads it is told what is wrong with it.
    return not is_own_format(data) and not has_areas(data)


def _expand_seeds(family: str, first: int, last: int) -> list[str]:
    from layoutexplore.maps.generator import FAMILIES

    if family not in FAMILIES:
        raise unknown_name("family", family, FAMILIES)
    if last - first >= MOST_SEEDS:
        raise MapError(f"{family}:{first}-{last}: at most {MOST_SEEDS} floor plans at once")
    if last < first:
        raise MapError(f"{family}:{first}-{last}: the last seed is smaller than the first")
    return [f"{family}:{seed}" for seed in range(first, last + 1)]


def _is_plan(path: Path) -> bool:
    """Whether a file of a folder is a floor plan of its own, not a part of another or something else."""
    suffix = path.suffix.lower()
    of_run = path.name in QUARTERLY_NAMES and is_of_run(path)
    if not path.is_file() or suffix not in SUFFIXES or path.name.startswith(".") or of_run:
        return False
    if suffix == ".json":
        return not path.stem.endswith(SIDECARS) and _is_json_plan(path)
    if suffix in IMAGE_SUFFIXES:
        part_of_another = any(is_file(path.with_suffix(ending)) for ending in (".geojson", *YAML_SUFFIXES))
        of_layout = is_file(path.with_name(f"{path.stem.rpartition('_')[0]}_layout.geojson"))
        return not (path.stem.endswith(("_rooms", "_gt")) or part_of_another or of_layout)
    return not (suffix == ".xml" and path.stem.endswith("_gt"))


@checks_arguments
def find_plans(specs: Iterable[str | os.PathLike[str]]) -> list[str]:
    """What `load_plan` can read, for names, files, folders and splits: each once, in the order given.

    Raises:
        MapError: A path does not exist, or a folder holds no floor plan.
        UnknownNameError: No plan or split of that name.
    """
    found: dict[str, None] = {}
    for spec in specs:
        for source in expand_plans(spec):
            path, level = split_level(source)
            here = f"{path.resolve()}#{level}" if level else str(path.resolve())
            found[here if is_there(path) else source] = None
    return list(found)


@checks_arguments
def cached_plan(source: str | os.PathLike[str]) -> FloorPlan:
    """Like `load_plan`; the last plans stay in memory until one of their files has changed."""
    text = os.fspath(source)
    return _cached(text, tuple(map(_state_of, source_files(text))))


_FileState = tuple[str, int, int]
"""Where a file lies, when it was changed (ns), and its bytes."""


def _state_of(path: Path) -> _FileState:
    try:
        found = path.stat()
    except (OSError, ValueError):  # none there, or a name that no file can have
        return str(path), 0, 0
    return str(path.absolute()), found.st_mtime_ns, found.st_size


@functools.lru_cache(maxsize=64)
def _cached(source: str, files: tuple[_FileState, ...]) -> FloorPlan:
    """The plan of that name or path; `files` keeps an edited one from being served stale."""
    return load_plan(source)
