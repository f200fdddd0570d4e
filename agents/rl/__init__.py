"""Learned policies: network, imitation, reinforcement learning, shipped weights (needs `pip install 'layoutexplore[rl]'`).

`hyperparameters` and `card` are plain Python; everything else imports torch.
"""
