"""Gymnasium environments over `layoutexplore.simulation`."""
