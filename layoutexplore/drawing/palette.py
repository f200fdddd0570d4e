"""The colours of every picture and report, in one place; safe for colour-blind readers.

The strong colours are those of Okabe and Ito, "Color Universal Design" (2008); the pale ones of the rooms are
mixed from Paul Tol's "light" scheme ("Colour Schemes", SRON technical note, 2021), which all readers can tell
apart.
"""

from __future__ import annotations

from layoutexplore.grids.arrays import Bytes

Image = Bytes
"""uint8 (height, width, 3), red, green, blue."""

Colour = tuple[int, int, int]
"""Red, green and blue, 0..255."""

BLACK: Colour = (0, 0, 0)
WHITE: Colour = (255, 255, 255)
ORANGE: Colour = (230, 159, 0)
SKY: Colour = (86, 180, 233)
GREEN: Colour = (0, 158, 115)
YELLOW: Colour = (240, 228, 66)
BLUE: Colour = (0, 114, 178)
VERMILLION: Colour = (213, 94, 0)
PURPLE: Colour = (204, 121, 167)
GREY: Colour = (128, 132, 140)

QUALITATIVE: tuple[Colour, ...] = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, GREY, BLACK)
"""For lines and bars, in the order in which they are to be used."""

ROOMS: tuple[Colour, ...] = (
    (187, 204, 238),
    (204, 221, 170),
    (238, 238, 187),
    (255, 204, 204),
    (204, 238, 255),
    (238, 221, 204),
    (226, 207, 238),
    (196, 232, 220),
    (250, 220, 176),
    (221, 221, 221),
)
"""Fills of rooms, used in turn; `layoutexplore.drawing.room_fills` keeps neighbours apart."""

# What a map is made of.
CANVAS: Colour = (228, 230, 234)
"""What is not known; the ground of every map picture."""
UNSEEN: Colour = (213, 217, 223)
"""True floor that the robot has not seen."""
PREDICTED: Colour = (158, 205, 232)
"""Floor that the robot has not seen and that a predictor takes for the rest of a room."""
MISTAKEN: Colour = (206, 223, 235)
"""The same where there is no floor to be seen."""
FREE: Colour = WHITE
WALL: Colour = (38, 44, 56)
INK: Colour = (32, 37, 48)
FADED_INK: Colour = (112, 120, 133)
PAPER: Colour = (250, 250, 248)
RULE: Colour = (216, 219, 224)
ROOM_NUMBER: Colour = (84, 92, 106)

# What happens on it.
ROBOT: Colour = BLUE
SIGHT: Colour = YELLOW
TRACK_NEW: Colour = BLUE
TRACK_OLD: Colour = (188, 213, 231)
PLANNED: Colour = INK
"""Where it goes next."""
GIVEN_UP: Colour = VERMILLION
"""Where it would have gone without the layout."""
FRONTIER: Colour = GREEN
"""A frontier that no predictor has judged."""
CLOSED: Colour = ORANGE
"""A frontier behind which an almost finished room ends."""
OPEN: Colour = PURPLE
"""A frontier that leads on."""


# How a prediction of what was never seen compares with the truth.
SEEN: Colour = (225, 236, 246)
"""What had been seen of a room."""
RIGHT: Colour = (86, 180, 140)
"""Predicted, and there."""
WRONG: Colour = (230, 120, 80)
"""Predicted, and not there."""
MISSED: Colour = (120, 170, 220)
"""There, and not predicted."""

# What the reports say with colours.
BETTER: Colour = BLUE
"""Fewer metres than the baseline, judged right."""
WORSE: Colour = VERMILLION
"""More metres than the baseline, judged wrong."""
RAMP: tuple[Colour, ...] = ((68, 1, 84), (59, 82, 139), (33, 145, 140), (94, 201, 98), (240, 200, 40))
"""From the start to the end of a way: dark violet to yellow."""


def to_hex(colour: Colour) -> str:
    """A colour as matplotlib and CSS write it.

    Example:
        >>> to_hex(BLUE)
        '#0072b2'
    """
    return "#{:02x}{:02x}{:02x}".format(*colour)


def mix(first: Colour, second: Colour, share: float) -> Colour:
    """The colour at `share` (0..1) of the way from the first to the second.

    Example:
        >>> mix(BLACK, WHITE, 0.5)
        (128, 128, 128)
    """
    red, green, blue = (round(a + (b - a) * share) for a, b in zip(first, second, strict=True))
    return red, green, blue


def room_colour(room: int) -> Colour:
    """The fill of the room with that id (1-based), unless a neighbour has it (`fills_of_rooms`)."""
    return ROOMS[(room - 1) % len(ROOMS)]
