"""The bottom drawer: occupancy grids and the primitives on them, each once."""

from layoutexplore.processes.compilation import tell_of_compilation

tell_of_compilation()
