"""How fast the hot paths are, as ratios to a reference that is timed in the same run.

`measure` runs named measurements (`layoutexplore.speed.kernels`, `layoutexplore.speed.environment`) and gives
one `SpeedRow` per figure, with its goal. Times are CPU time of one thread, so that a busy machine disturbs
them little; what is compared takes turns.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from layoutexplore.speed.measurement import Measurement as Measurement
from layoutexplore.speed.measurement import SpeedRow as SpeedRow

if TYPE_CHECKING:
    from layoutexplore.speed.suite import measure as measure
    from layoutexplore.speed.suite import measurements as measurements


def __getattr__(name: str) -> Any:
    """What imports all measurements, when it is asked for: a run measured alone is to hold none of them."""
    if name not in ("measure", "measurements"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from layoutexplore.speed import suite

    return getattr(suite, name)
