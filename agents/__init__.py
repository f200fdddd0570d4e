"""Exploration strategies: heuristics here, learned policies in `layoutexplore.agents.rl`."""
