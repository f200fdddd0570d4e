"""Training of the predictor of rooms: explorations, samples, forests and networks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from layoutexplore.files import is_there, safe_name
from layoutexplore.maps.formats.building_files import split_level
from layoutexplore.maps.library import load_plan

if TYPE_CHECKING:
    from layoutexplore.maps.floorplan import FloorPlan
    from layoutexplore.predictors.snapshot import Snapshot
    from layoutexplore.training.cell_network import TrainableCellNetwork
    from layoutexplore.training.predictor_samples import CellNetworkSample, CropSamples, PredictorSamples


StepsLine = Callable[[str], AbstractContextManager[Callable[[int, int, float], None]]]


@dataclass(frozen=True, kw_only=True)
class ExplorationConfig:
    """How plans are explored.

    Attributes:
        starts: Explorations by each sensor of a plan from a file; of others there is one.
        stretched: Copies of each plan from a file, stretched at random, to learn from as well.
        stops: Decisions kept of an exploration.
        store: Folder in which explorations are kept.
    """

    starts: int = 1
    stretched: int = 0
    stops: int = 8
    store: Path | None = None


@dataclass(frozen=True, eq=False)
class Explored:
    """What explorations have shown.

    Attributes:
        files: Plans from files.
        copies: Names of stretched copies, each with its plan's name.
        samples: For trees, by plan.
        scenes: For the cell network.
        crops: For the frontier network.
        asked: Decisions for tests, by the names of plans; those of one name, which count as one building,
            together.
        loaded_as: By what each plan from a file was loaded.
    """

    files: list[FloorPlan]
    copies: dict[str, str]
    samples: list[PredictorSamples]
    scenes: list[CellNetworkSample]
    crops: list[CropSamples]
    asked: dict[str, list[Snapshot]]
    loaded_as: list[str]


def explore_plans(
    sources: Sequence[str],
    config: ExplorationConfig,
    *,
    forests: bool,
    network: bool,
    rooms: bool,
    progress: Callable[[int, int, str], None],
) -> Explored:
    """Explore plans; those from files more often, and as the tests ask, too.

    What lies askew is learnt from upright, and tested as it is. What only models of rooms learn from is not
    gathered unless they are trained.
    """
    from layoutexplore.agents import make_agent
    from layoutexplore.errors import ConfigError
    from layoutexplore.training.explorations import (
        protocol_explorations,
        stopped_explorations,
        stretched_copies,
        upright_plan,
    )
    from layoutexplore.training.predictor_samples import gather, gather_crops, gather_network_inputs

    seen = Explored([], {}, [], [], [], {}, [])
    stops, store = config.stops, config.store
    for k, source in enumerate(sources):
        plan = load_plan(source)
        is_file = is_there(split_level(source)[0])  # One floor of a file of several is from a file, too.
        upright = upright_plan(plan)
        found = list(stopped_explorations(upright, make_agent, config.starts if is_file else 1, stops, store))
        if is_file:
            protocol = list(protocol_explorations(plan, make_agent, store))
            askew = upright is not plan
            found.extend(protocol_explorations(upright, make_agent, store) if askew else protocol)
            for copy in stretched_copies(upright, config.stretched):
                found.extend(stopped_explorations(copy, make_agent, 1, stops, store))
                seen.copies[copy.name] = plan.name
            seen.files.append(plan)
            seen.loaded_as.append(source)
            asked = seen.asked.setdefault(plan.name, [])
            asked.extend(snapshot for part in protocol for snapshot in part if forests)
        if forests:
            seen.samples.append(gather(found, cells=rooms))
        if network:
            for exploration in found:
                if rooms:
                    seen.scenes.extend(gather_network_inputs(exploration))
                seen.crops.append(gather_crops(exploration, plan.name))
        progress(k + 1, len(sources), plan.name)
    frontiers = [len(part.closed) for part in seen.samples] + [len(part.closed) for part in seen.crops]
    if not any(frontiers) or (rooms and network and not seen.scenes):
        raise ConfigError(
            "nothing to learn from: no exploration stopped before all was seen; give plans of several rooms"
        )
    return seen


def buildings_of(seen: Explored, folds: int) -> dict[str, str]:
    """The group of each plan from a file and of its copies; there are enough of them for the folds."""
    from layoutexplore.maps.buildings import group_buildings
    from layoutexplore.training.folds import check_folds

    groups = group_buildings(seen.files)
    groups |= {copy: groups[name] for copy, name in seen.copies.items()}
    if folds:
        check_folds(folds, groups.values())
    return groups


def parts_by_source(
    seen: Explored, groups: Mapping[str, str], sources: Mapping[str, Sequence[str]]
) -> dict[str, str]:
    """The source with which each group of buildings is left out, as "without-NAME".

    A building of which two sources have floors is left out with the first.

    Args:
        seen: What explorations have shown.
        groups: The group of each plan from a file.
        sources: What can be loaded of each source, by the word that names it; generated plans are of none.

    Raises:
        ConfigError: The plans from files are of one source only.

    Example:
        >>> from layoutexplore.maps.tracing import floorplan_from_ascii
        >>> plans = [floorplan_from_ascii(".a", name=name) for name in ("hall", "tower")]
        >>> loaded = ["a/hall.geojson", "b/tower.geojson"]
        >>> seen = Explored(plans, {}, [], [], [], {}, loaded)
        >>> words = {"a/": ["a/hall.geojson"], "b/": ["b/tower.geojson"]}
        >>> parts_by_source(seen, {"hall": "hall", "tower": "tower"}, words)
        {'hall': 'without-a', 'tower': 'without-b'}
    """
    from layoutexplore.errors import ConfigError

    word_of = {found: word for word in reversed([*sources]) for found in sources[word]}
    names: dict[str, str] = {}
    for word in sources:
        name = f"without-{safe_name(Path(word).name)}"
        names[word] = name if name not in names.values() else f"without-{safe_name(word)}"
    parts: dict[str, str] = {}
    for plan, source in zip(seen.files, seen.loaded_as, strict=True):
        parts.setdefault(groups[plan.name], names[word_of[source]])
    if len(set(parts.values())) < 2:
        raise ConfigError("leaving out a source takes plans from files of at least two words of the command")
    return parts


def buildings_of_words(
    seen: Explored, groups: Mapping[str, str], sources: Mapping[str, Sequence[str]], words: Sequence[str]
) -> frozenset[str]:
    """The groups of buildings of some sources.

    Args:
        seen: What explorations have shown.
        groups: The group of each plan from a file.
        sources: What can be loaded of each source, by the word that names it.
        words: Some of these words.
    """
    loaded = {source for word in words for source in sources[word]}
    return frozenset(
        groups[plan.name] for plan, source in zip(seen.files, seen.loaded_as, strict=True) if source in loaded
    )


class NetworkTrainer:
    """Trains networks; those for rooms all begin as one that has learnt from generated plans.

    Args:
        seen: All samples.
        groups: The group of each plan that comes from a file; all others count as generated.
        first_steps: Steps of the network for rooms on generated plans.
        steps: Its steps on all plans.
        frontier_steps: Steps of the frontier network.
        steps_line: Opens a display of progress for what is named; takes steps done, of all, and the loss.
        rooms: Train those for rooms at all.
    """

    def __init__(
        self,
        seen: Explored,
        groups: Mapping[str, str],
        first_steps: int,
        steps: int,
        frontier_steps: int,
        steps_line: StepsLine,
        *,
        rooms: bool = True,
    ) -> None:
        from layoutexplore.training.cell_network import CellNetworkConfig, pretrain_cell_network

        self._config = CellNetworkConfig(first_steps=first_steps, steps=steps)
        self._frontier_steps = frontier_steps
        self._steps_line = steps_line
        self._seen, self._groups = seen, groups
        self._generated = [sample for sample in seen.scenes if sample.plan not in groups]
        self._first = None
        if not rooms:
            return
        with self._steps_line("rooms of generated plans") as progress:
            self._first = pretrain_cell_network(self._generated, self._config, progress)

    def write(self, folder: Path, wanted: Callable[[str], bool]) -> None:
        """Train all networks with the real buildings of the wanted groups and write them into a folder."""
        plans = {plan for plan, group in self._groups.items() if wanted(group)}
        if self._first is not None:
            self._write_rooms(self._first, folder, plans)
        self._write_frontiers(folder, plans)

    def _write_rooms(self, first: TrainableCellNetwork, folder: Path, plans: set[str]) -> None:
        """Let the network for rooms go on from a first one with some of the real plans."""
        from layoutexplore.models.network_files import save_weights
        from layoutexplore.predictors.learned import CELL_NETWORK
        from layoutexplore.training.cell_network import train_cell_network

        real = [sample for sample in self._seen.scenes if sample.plan in plans]
        with self._steps_line("rooms of all plans") as progress:
            weights = train_cell_network(first, self._generated, real, self._config, progress)
        others = len({sample.plan for sample in real})
        note = f"{len(self._generated)} decisions of generated plans, {len(real)} of {others} others"
        save_weights(
            folder / CELL_NETWORK.name,
            {name: values.astype("float16") for name, values in weights.items()},
            note,
        )

    def _write_frontiers(self, folder: Path, plans: set[str]) -> None:
        """Train the network for frontiers with some of the real plans."""
        from layoutexplore.models.network_files import save_weights
        from layoutexplore.predictors.learned import FRONTIER_NETWORK
        from layoutexplore.training.frontier_network import FrontierNetworkConfig, train_frontier_network

        generated = [part for part in self._seen.crops if part.plan not in self._groups]
        crops = [part for part in self._seen.crops if part.plan in plans]
        with self._steps_line("frontiers of all plans") as progress:
            config = FrontierNetworkConfig(steps=self._frontier_steps)
            rounded = train_frontier_network(generated, crops, self._groups, config, progress)
        counts = [sum(len(part.closed) for part in parts) for parts in (generated, crops)]
        others = len({part.plan for part in crops})
        note = f"{counts[0]} frontiers of generated plans, {counts[1]} of {others} others"
        save_weights(folder / FRONTIER_NETWORK.name, rounded, note)


def rooms_of(folder: str) -> dict[str, bytes]:
    """What is in the files of the models that judge rooms, of a folder of models or the "shipped" ones.

    Raises:
        ConfigError: There are none, or this version cannot run them.
    """
    from layoutexplore.predictors.learned import CELL_MODEL, CELL_NETWORK, FOLDER, LearnedPredictor

    taken = FOLDER if folder == "shipped" else Path(folder)
    LearnedPredictor(taken)
    paths = (taken / path.name for path in (CELL_MODEL, CELL_NETWORK))
    return {path.name: path.read_bytes() for path in paths if path.exists()}


def write_rooms(folder: Path, taken: Mapping[str, bytes]) -> None:
    """Write what `rooms_of` found into a folder of models."""
    from layoutexplore.files import write_atomically

    for name, model in taken.items():
        write_atomically(folder / name, model)


def forget_networks(folder: Path) -> None:
    """Delete the networks of an earlier training, which may have learnt from what is held out now."""
    from layoutexplore.predictors.learned import CELL_NETWORK, FRONTIER_NETWORK

    for path in (FRONTIER_NETWORK, CELL_NETWORK):
        (folder / path.name).unlink(missing_ok=True)
