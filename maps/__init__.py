"""Floor plans: loaders (one format a file), the plans that ship, and the procedural generator."""

from __future__ import annotations

from layoutexplore.maps.library import expand_plans, load_plan, plan_names, splits

__all__ = ["expand_plans", "load_plan", "plan_names", "splits"]
