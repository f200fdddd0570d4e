"""Render modes: frames as arrays, a window, and text. Nothing here changes the simulation."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from gymnasium.error import DependencyNotInstalled

from layoutexplore.drawing.pictures import draw_state
from layoutexplore.errors import ConfigError, MissingExtraError, checks_arguments, require, shortened
from layoutexplore.grids.arrays import Bytes
from layoutexplore.grids.grid import FREE, OCCUPIED
from layoutexplore.options import COUNT, Rule
from layoutexplore.simulation.simulation import Simulation

RENDER_MODES = ("human", "rgb_array", "ansi")
_GLYPHS = " .#?"
_UNKNOWN, _FREE, _WALL, _FRONTIER = range(4)
_HEADINGS = ">^<v"


class MissingWindowError(MissingExtraError, DependencyNotInstalled):
    """The mode "human" needs pygame."""


class Viewer:
    """Draws a simulation in one render mode.

    Args:
        mode: One of `RENDER_MODES`, or None to draw nothing.
        size: Width and height of frames in pixels.
        fps: Frames per second that the window shows at most.
        frontiers: Whether frontiers are shown; computing them counts as a decision that is due.

    Raises:
        ConfigError: There is no such mode, or the size makes no sense.
        MissingWindowError: The mode is "human" and pygame is not installed.
    """

    def __init__(self, mode: str | None, size: tuple[int, int], fps: int, *, frontiers: bool) -> None:
        if mode is not None and (not isinstance(mode, str) or mode not in RENDER_MODES):
            raise ConfigError(
                f"render_mode must be one of {', '.join(RENDER_MODES)} or None, got {shortened(mode)}"
            )
        size = Rule(kind=int, low=1, high=16_384, count=2).convert("render_size", size)
        self.mode, self.size, self._fps, self._frontiers = mode, size, fps, frontiers
        self._window: Any = None
        if mode == "human":
            _pygame()

    def draw(self, simulation: Simulation) -> Bytes | str | None:
        """A frame uint8 (height, width, 3), the text, or None after showing the frame in the window."""
        if self.mode == "ansi":
            return draw_text(simulation, frontiers=self._frontiers)
        frame = draw_state(simulation, size=self.size, frontiers=self._frontiers)
        if self.mode == "rgb_array":
            return frame
        self._show(frame)
        return None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            pygame = _pygame()
            pygame.display.quit()
            self._window = None

    def _show(self, frame: Bytes) -> None:
        pygame = _pygame()
        if self._window is None:
            pygame.display.init()
            pygame.display.set_caption("layoutexplore")
            self._window = pygame.display.set_mode(self.size)
            self._clock = pygame.time.Clock()
        self._window.blit(pygame.surfarray.make_surface(frame.swapaxes(0, 1)), (0, 0))
        pygame.event.pump()
        pygame.display.flip()
        self._clock.tick(self._fps)

    def __getstate__(self) -> dict[str, Any]:
        state = self.__dict__.copy()
        state["_window"] = None
        state.pop("_clock", None)
        return state


@checks_arguments
def draw_text(simulation: Simulation, *, columns: int = 100, frontiers: bool = True) -> str:
    """What is known, in letters: `#` wall, `.` free, `?` frontier, an arrow the robot, blank the unknown.

    Args:
        simulation: A simulation that has been reset.
        columns: Greatest width; a letter stands for a block of cells twice as high as wide.
        frontiers: Whether to show frontiers.
    """
    COUNT.convert("columns", columns)
    cells = simulation.mapper.grid.cells
    ranks: Bytes = np.full(cells.shape, _UNKNOWN, np.uint8)
    ranks[cells == FREE] = _FREE
    ranks[cells == OCCUPIED] = _WALL
    if frontiers:
        ranks[tuple(simulation.decision.clusters.cells.T)] = _FRONTIER
    rows, cols = np.flatnonzero(ranks.any(axis=1)), np.flatnonzero(ranks.any(axis=0))
    ranks = ranks[rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1]
    wide = max(1, math.ceil(ranks.shape[1] / columns))
    high = 2 * wide
    blocks = np.maximum.reduceat(ranks, range(0, ranks.shape[0], high))
    blocks = np.maximum.reduceat(blocks, range(0, ranks.shape[1], wide), axis=1)
    letters = np.array(list(_GLYPHS))[blocks]
    pose = simulation.robot.believed
    here = simulation.mapper.grid.nearest_cell(pose.x, pose.y)
    row, col = np.clip(here, (rows[0], cols[0]), (rows[-1], cols[-1])) - (rows[0], cols[0])
    letters[row // high, col // wide] = _HEADINGS[round(pose.theta / (math.pi / 2)) % 4]
    state = simulation.stop_reason or "exploring"
    seen = f"{100 * simulation.coverage:.1f} % seen, {simulation.distance:.1f} m"
    head = f"{simulation.plan.name}: {seen}, {state}"
    return "\n".join([head, *("".join(line).rstrip() for line in letters[::-1])])


def _pygame() -> Any:
    try:
        return require("pygame", "human")
    except MissingExtraError as error:
        raise MissingWindowError(str(error)) from error
