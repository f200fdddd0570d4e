"""Programmes: which rooms a kind of building has, how wide they are, how often they come, as data.

Widths and depths are in metres between wall centre lines. They follow common practice (planning grid of
1.2-1.5 m, cellular offices one window axis or two to three modules wide, classrooms of 50-70 m2, wards with
their own bathroom), and were compared with the room sizes of real schools and campus floors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from layoutexplore.maps.generator import bays
from layoutexplore.maps.generator.bays import Builder

Range = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class RoomType:
    """A kind of room.

    Attributes:
        label: The room's label in the plan.
        width: Along the corridor, m.
        run: How many equal ones stand in a row, from and to.
        weight: How often a run of it is drawn, relative to the others.
        build: Draws it into its bay.
        depth: Own depth, m, when it differs from the band (halls stick out of the outline); None = the
            band's.
    """

    label: str
    width: Range
    run: tuple[int, int] = (1, 1)
    weight: float = 1.0
    build: Builder = bays.plain
    depth: Range | None = None


@dataclass(frozen=True, kw_only=True)
class Programme:
    """What a kind of building is made of.

    Attributes:
        facade: Rooms that want daylight, drawn by weight along the facades.
        core: Rooms of the dark zones, taken in turn; the first ones are also set into long facades.
        special: Rooms that a plan has once (lobby, hall), the most important first.
        end: Rooms across the end of a corridor.
        depth: Depth of the bands of rooms, m.
        corridor: Width of the corridors, m.
        module: Planning grid along the facade, m.
        connecting: Probability of a door between neighbours of the same kind.
        core_every: Metres of wing that share one core.
        special_share: Largest share of the area for one special room.
    """

    facade: tuple[RoomType, ...]
    core: tuple[RoomType, ...]
    special: tuple[RoomType, ...]
    end: tuple[RoomType, ...]
    depth: Range
    corridor: Range
    module: Range = (1.2, 1.5)
    connecting: float = 0.1
    core_every: float = 38.0
    special_share: float = 0.12


STAIRS = RoomType(label="stairs", width=(2.7, 3.4), build=bays.stairs)
TOILETS = RoomType(label="toilet", width=(2.6, 4.2), build=bays.toilets)
LIFT = RoomType(label="storage", width=(3.6, 4.6), build=bays.shaft)
STORE = RoomType(label="storage", width=(1.8, 3.2))
WASHROOM = RoomType(label="toilet", width=(3.0, 4.5), build=bays.enfilade)
CORE = (STAIRS, TOILETS, LIFT, STORE, RoomType(label="office", width=(2.7, 4.2)))

OFFICE = Programme(
    facade=(
        RoomType(label="office", width=(2.4, 3.0), run=(3, 7), weight=3.0),
        RoomType(label="office", width=(3.3, 4.5), run=(2, 6), weight=4.0),
        RoomType(label="office", width=(4.8, 6.0), run=(1, 3), weight=2.2),
        RoomType(label="meeting", width=(5.0, 8.0), weight=1.3),
        RoomType(label="office", width=(3.6, 4.8), run=(1, 2), weight=0.5, build=bays.enfilade),
        RoomType(label="open office", width=(9.0, 15.0), weight=0.6, build=bays.beside),
        RoomType(label="laboratory", width=(6.0, 10.0), run=(1, 2), weight=1.2),
        RoomType(label="kitchen", width=(3.0, 4.5), weight=0.4),
        RoomType(label="storage", width=(1.8, 2.4), weight=0.5),
    ),
    core=CORE,
    special=(
        RoomType(label="lobby", width=(5.0, 9.0), build=bays.foyer),
        RoomType(label="meeting", width=(7.0, 11.0), build=bays.big, depth=(6.0, 9.0)),
        RoomType(label="cafeteria", width=(10.0, 16.0), build=bays.big, depth=(8.0, 12.0)),
    ),
    end=(
        RoomType(label="meeting", width=(4.8, 7.0), weight=1.0),
        RoomType(label="open office", width=(6.0, 10.0), weight=1.0),
    ),
    depth=(4.4, 6.0),
    corridor=(1.8, 2.6),
    connecting=0.12,
)

OFFICE_DEEP = replace(
    OFFICE,
    core=(
        RoomType(label="laboratory", width=(8.0, 15.0), build=bays.big),
        replace(STAIRS, width=(2.8, 3.4)),
        replace(TOILETS, width=(2.6, 4.0)),
        RoomType(label="laboratory", width=(5.0, 9.0), build=bays.beside),
        RoomType(label="lecture hall", width=(9.0, 14.0), build=bays.big),
        RoomType(label="storage", width=(2.8, 4.0), build=bays.enfilade),
        RoomType(label="office", width=(2.8, 4.2), build=bays.enfilade),
    ),
)
"""Offices on the facades, laboratories and lecture halls between two corridors, as on technical campuses."""

SCHOOL = Programme(
    facade=(
        RoomType(label="classroom", width=(7.5, 9.5), run=(2, 5), weight=7.0),
        RoomType(label="classroom", width=(7.5, 9.5), run=(2, 3), weight=1.5, build=bays.alcove),
        RoomType(label="laboratory", width=(9.0, 11.5), weight=0.8, build=bays.beside),
        RoomType(label="classroom", width=(5.0, 6.5), run=(1, 2), weight=1.2),
        RoomType(label="office", width=(3.0, 4.5), run=(1, 3), weight=0.8),
        RoomType(label="storage", width=(2.4, 3.2), weight=0.5, build=bays.enfilade),
        RoomType(label="office", width=(3.2, 4.2), run=(1, 1), weight=0.3, build=bays.enfilade),
    ),
    core=(STAIRS, WASHROOM, RoomType(label="office", width=(4.5, 7.0)), STORE),
    special=(
        RoomType(label="lobby", width=(8.0, 13.0), build=bays.foyer),
        RoomType(label="gym", width=(15.0, 22.0), build=bays.big, depth=(18.0, 28.0)),
        RoomType(label="aula", width=(11.0, 17.0), build=bays.big, depth=(10.0, 16.0)),
        RoomType(label="library", width=(9.0, 13.0), build=bays.big, depth=(8.0, 10.0)),
    ),
    end=(
        RoomType(label="classroom", width=(7.0, 9.0), weight=1.5),
        RoomType(label="library", width=(8.0, 11.0), weight=0.5),
    ),
    depth=(6.3, 8.2),
    corridor=(2.4, 4.0),
    connecting=0.1,
    core_every=45.0,
    special_share=0.2,
)

HOSPITAL = Programme(
    facade=(
        RoomType(label="ward", width=(3.6, 4.4), run=(4, 10), weight=8.0, build=bays.with_bathroom),
        RoomType(label="ward", width=(5.4, 6.6), run=(1, 3), weight=1.2, build=bays.with_bathroom),
        RoomType(label="treatment", width=(3.6, 5.4), run=(1, 3), weight=1.2),
        RoomType(label="day room", width=(5.4, 7.5), weight=0.7, build=bays.lounge),
        RoomType(label="office", width=(2.7, 3.6), run=(1, 3), weight=0.8),
        RoomType(label="storage", width=(1.8, 2.4), weight=0.4),
    ),
    core=(
        STAIRS,
        LIFT,
        RoomType(label="nurse station", width=(4.5, 7.0), build=bays.big),
        RoomType(label="storage", width=(2.4, 3.6)),
        TOILETS,
        RoomType(label="treatment", width=(3.6, 5.0)),
    ),
    special=(
        RoomType(label="lobby", width=(6.0, 10.0), build=bays.foyer),
        RoomType(label="cafeteria", width=(9.0, 13.0), build=bays.big, depth=(8.0, 10.0)),
    ),
    end=(RoomType(label="day room", width=(5.0, 7.0)), RoomType(label="ward", width=(5.4, 7.0))),
    depth=(5.8, 7.2),
    corridor=(2.2, 2.8),
    connecting=0.03,
)
