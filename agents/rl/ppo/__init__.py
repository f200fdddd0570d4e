"""Masked PPO at the speed of the environments.

`layoutexplore speed --only training` prints its rate and that of sb3-contrib's `MaskablePPO`.
"""
