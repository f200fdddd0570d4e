"""The bottom drawer: occupancy grids and the primitives on them, each once."""

from layoutexplore.processes.compilation import tell_of_compilation
from layoutexplore.processes.kernel_memory import keep_kernels_lean

keep_kernels_lean()
tell_of_compilation()
