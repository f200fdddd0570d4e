"""What a policy is: the part of it that a program needs (`PolicySpec`), and the card that a person reads.

A policy is a `.safetensors` file with the weights of the actor. Its header holds the card, a TOML text whose
table `[policy]` is the spec: weights and card cannot come apart. The same text lies beside it as `.toml` to
be read. Nothing is unpickled.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import layoutexplore
from layoutexplore.agents.rl.hyperparameters import LONGEST_WAY, NetworkConfig, TrainingConfig
from layoutexplore.envs.egocentric_maps import CHANNELS, LAYOUT_CHANNELS
from layoutexplore.envs.observation import FRONTIER_FEATURES, ROBOT_FEATURES
from layoutexplore.errors import (
    ConfigError,
    ResultsError,
    UnknownNameError,
    cause,
    checks_arguments,
    shortened,
    unknown_name,
)
from layoutexplore.files import is_there, parse_toml
from layoutexplore.files.reading import shown_path
from layoutexplore.files.schema import Anything, Items, Number, Record, TableOf, Text
from layoutexplore.files.tensors import read_metadata
from layoutexplore.frontiers.tour_features import TourConfig

FORMAT = 1
"""Version of the file format and of what the features mean."""

WEIGHTS = Path(__file__).resolve().parent / "weights"
"""Folder of the policies that ship."""

_UNUSED_FRONTIER = {"valid"}
_OF_THE_TOUR = {"detour", "tour_rank"}
_ROBOT = ("distance", "known_area", "expected_area")
_ROBOT_ON_MAP = ("map_x", "map_y", "map_span")


@dataclass(frozen=True, kw_only=True)
class PolicySpec:
    """What has to be known to build a policy's network and to feed it.

    Attributes:
        network: Shape of the network.
        frontier_features: Columns of `FRONTIER_FEATURES` that it reads, in its order.
        robot_features: Entries of `ROBOT_FEATURES` that it reads, in its order.
        map_channels: Channels of the global map that it reads; empty for no map.
        predictor: The predictor of rooms that it was trained with.
        sensors: The lidars that it was trained with.
        tour: How the tour that it is shown weighs ways and areas.
        look_every: Metres after which it looks all around on its way, where that shows more; 0: never.
        watchful: Weight of 1 / the place in the tour of `watchful-tour`, beside its own logits, where the
            lidar sees all around; above 0 it decides every `look_every` metres there, too.
        format: Version of the format.
        version: Version of layoutexplore that wrote it.
    """

    network: NetworkConfig
    frontier_features: tuple[str, ...]
    robot_features: tuple[str, ...]
    map_channels: tuple[str, ...] = ()
    predictor: str = "none"
    sensors: tuple[str, ...] = ()
    tour: TourConfig = field(default_factory=TourConfig)
    look_every: float = 0.0
    watchful: float = 0.0
    format: int = FORMAT
    version: str = layoutexplore.__version__

    @property
    def reads_tour(self) -> bool:
        """Whether it has to be shown the tour."""
        return not _OF_THE_TOUR.isdisjoint(self.frontier_features)

    @property
    def frontier_columns(self) -> list[int]:
        """Where its features of a frontier stand among `FRONTIER_FEATURES`."""
        return [list(FRONTIER_FEATURES).index(name) for name in self.frontier_features]

    @property
    def robot_columns(self) -> list[int]:
        """Where its features of the robot stand among `ROBOT_FEATURES`."""
        return [list(ROBOT_FEATURES).index(name) for name in self.robot_features]

    @property
    def rank_column(self) -> int | None:
        """Where 1 / the place in the tour stands among its features; it alone is not compressed by asinh."""
        return self.frontier_features.index("tour_rank") if "tour_rank" in self.frontier_features else None

    @property
    def cost_feature(self) -> str:
        """The feature of a frontier that speaks against it from the start: the detour, or else the way."""
        return "path_length" if self.rank_column is None else "detour"

    def as_table(self) -> dict[str, Any]:
        """Nested plain values for TOML."""
        return {k: list(v) if isinstance(v, tuple) else v for k, v in dataclasses.asdict(self).items()}


def spec_of(config: TrainingConfig) -> PolicySpec:
    """The spec of the policy that a configuration trains."""
    assert config.network is not None
    maps = bool(config.observation["global_map"])
    unused = _UNUSED_FRONTIER if config.observation["detour"] else _UNUSED_FRONTIER | _OF_THE_TOUR
    return PolicySpec(
        network=config.network,
        frontier_features=tuple(name for name in FRONTIER_FEATURES if name not in unused),
        robot_features=_ROBOT + (_ROBOT_ON_MAP if maps else ()),
        map_channels=CHANNELS + LAYOUT_CHANNELS if maps else (),
        predictor=config.predictor,
        sensors=config.sensors,
        tour=config.tour,
        look_every=config.look_every,
    )


@checks_arguments
def find_policy(name: str | os.PathLike[str]) -> Path:
    """The file of a policy by its path, the folder of its training run (the best one), or a shipped name.

    Raises:
        ConfigError: There is no such policy.
    """
    name = os.fspath(name)
    shipped = {path.stem: path for path in sorted(WEIGHTS.glob("*.safetensors"))}
    if name in shipped:
        return shipped[name]
    # Homes of nobody are left as they are: no file is there.
    path = Path(os.path.expanduser(name))  # noqa: PTH111
    if is_there(path) and path.is_dir():
        for candidate in ("best.safetensors", "policy.safetensors"):
            if (path / candidate).is_file():
                return path / candidate
        raise ConfigError(
            f"no policy in the folder {path}: it has neither best.safetensors nor policy.safetensors"
        )
    if is_there(path) and path.is_file():
        return path
    if len(path.parts) == 1 and not path.suffix:
        problem = unknown_name("policy", name, shipped)
        raise UnknownNameError(
            f"{problem}. A .safetensors file or a folder of `layoutexplore train` does, too"
        )
    raise ConfigError(
        f"there is no policy {shown_path(path)}: give a .safetensors file, a folder of `layoutexplore train` "
        f"or a shipped name ({', '.join(shipped)})"
    )


_NAMES = Items(Text(most=200), 0, 200)
_CARD = Record(
    {
        "network": TableOf(Anything()),
        "frontier_features": Items(Text(most=200), 1, 200),
        "robot_features": _NAMES,
    },
    {
        "map_channels": _NAMES,
        "predictor": Text(most=1000),
        "sensors": _NAMES,
        "tour": TableOf(Anything()),
        "look_every": Number(low=0.0, high=LONGEST_WAY),
        "watchful": Number(low=0.0, high=1e6),
        "version": Text(most=200),
    },
)
"""What the table [policy] of a card must hold."""


@checks_arguments
def read_card(path: str | os.PathLike[str]) -> dict[str, Any]:
    """The card in the header of a policy's file, as nested values.

    Raises:
        ResultsError: The file cannot be read, is no policy, or is cut off.
    """
    path = Path(path)
    metadata = read_metadata(path, what="policy")
    if "card" not in metadata:
        raise ResultsError(f"{path} is not a policy of layoutexplore: its header has no card")
    return parse_toml(metadata["card"], f"{path}: its card", error=ResultsError)


@checks_arguments
def read_spec(path: str | os.PathLike[str]) -> PolicySpec:
    """The spec of a policy's file, checked against what this version can feed it.

    Raises:
        ResultsError: It is no such file, was written in another format, or needs features that do not exist
            here.
    """
    path = Path(path)
    table = read_card(path).get("policy")
    if not isinstance(table, Mapping):
        raise ResultsError(
            f"{path}: the card has no table [policy]: it does not choose frontiers, "
            "so it cannot be an agent here"
        )
    if table.get("format") != FORMAT:
        raise ResultsError(
            f"{path} has format {shortened(table.get('format'))} "
            f"(layoutexplore {shortened(table.get('version'))}); this is layoutexplore "
            f"{layoutexplore.__version__}, which reads format {FORMAT}: train it again"
        )
    spec = _spec_of_table(table, path)
    for kind, names, known in (
        ("frontier features", spec.frontier_features, FRONTIER_FEATURES),
        ("robot features", spec.robot_features, ROBOT_FEATURES),
        ("map channels", spec.map_channels, CHANNELS + LAYOUT_CHANNELS),
    ):
        if missing := [name for name in names if name not in known]:
            raise ResultsError(
                f"{path} was trained with {kind} that this version does not have: {', '.join(missing)[:300]}"
            )
        if len(set(names)) < len(names):
            raise ResultsError(f"{path}: its card names one of the {kind} twice")
    return spec


def _spec_of_table(table: Mapping[str, Any], path: Path) -> PolicySpec:
    try:
        fitted = _CARD.fit(table, "policy")
        values: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in fitted.items()}
        parts = {"network": NetworkConfig(**table["network"]), "tour": TourConfig(**table.get("tour", {}))}
        return PolicySpec(**{**values, **parts})
    except (TypeError, KeyError, ValueError, ConfigError) as error:
        raise ResultsError(
            f"{path}: the table [policy] of its card is not understood: {cause(error)}"
        ) from error
