"""Procedural floor plans: seven families of buildings, any size from 100 to 8000 m2, one seed = one plan.

Example:
    >>> plan = generate("office", 3, area=300.0)
    >>> plan.name, plan.building
    ('office-3', 'office-3')
    >>> abs(plan.area / 300.0 - 1.0) < 0.25
    True
"""

from __future__ import annotations

from layoutexplore.maps.generator.config import TOPOLOGIES, PlanConfig
from layoutexplore.maps.generator.generate import FAMILIES, generate

__all__ = ["FAMILIES", "TOPOLOGIES", "PlanConfig", "generate"]
