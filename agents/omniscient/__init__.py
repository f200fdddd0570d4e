"""Agents that know the floor plan: bounds, not strategies."""
