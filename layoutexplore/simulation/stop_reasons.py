"""Why an exploration ended, by name and in a sentence."""

from __future__ import annotations

from enum import StrEnum


class StopReason(StrEnum):
    """Why a run ended; equal to its text, so that `simulation.stop_reason == "coverage"` holds.

    Example:
        >>> StopReason("budget").sentence
        'the budget of metres is spent'
    """

    GOES_ON = ""
    COVERAGE = "coverage"
    NO_FRONTIER = "no_frontier"
    BUDGET = "budget"
    AGENT = "agent"

    @property
    def sentence(self) -> str:
        """The reason in words."""
        return _SENTENCES[self]


_SENTENCES = {
    StopReason.GOES_ON: "it goes on",
    StopReason.COVERAGE: "as much was seen as was asked for",
    StopReason.NO_FRONTIER: "no frontier is left that the robot can look at",
    StopReason.BUDGET: "the budget of metres is spent",
    StopReason.AGENT: "the agent stopped",
}
