"""Shortest paths on grids and tours over places."""
