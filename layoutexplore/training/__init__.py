"""Every model that ships, made: samples, folds by building, forests and networks. Policies train in `layoutexplore.agents.rl`."""
