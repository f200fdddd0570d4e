"""Files of a run's folder by the quarter of the floor that was seen."""

from __future__ import annotations

QUARTERLY = ("seen_{:03}.png", "prior_{:03}.png", "rooms_{:03}.geojson")
"""By percent seen: pictures, a plan known beforehand, the rooms believed."""

QUARTERLY_NAMES = tuple(name.format(percent) for name in QUARTERLY for percent in range(0, 101, 25))
"""All that a run may have."""
