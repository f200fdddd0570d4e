"""Readers of other programs' formats: buildings as GIS, indoor navigation and robot fleets know them."""
