"""The bottom drawer: occupancy grids and the primitives on them, each once."""
