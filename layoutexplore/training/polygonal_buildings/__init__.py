"""Drawn buildings whose walls run in many directions, to train the merging of regions on."""
