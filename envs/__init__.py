"""Gymnasium environments over `layoutexplore.simulation.simulation`.

`import layoutexplore` registers `LayoutExplore/Frontier-v0` (`layoutexplore.envs.frontier`) and
`LayoutExplore/Motion-v0` (`layoutexplore.envs.motion`); their class docstrings are their documentation.
"""
