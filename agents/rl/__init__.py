"""Learned policies: networks, imitation, search, reinforcement learning, shipped weights.

`hyperparameters`, `card` and `linear` need no torch; all else needs `pip install 'layoutexplore[rl]'`.
"""
