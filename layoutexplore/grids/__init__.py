"""The bottom drawer: occupancy grids and the primitives on them, each once."""

import contextlib

from layoutexplore.processes.compilation import tell_of_compilation

# A numba that has its code elsewhere only needs more memory.
with contextlib.suppress(ImportError):
    from layoutexplore.processes.kernel_memory import keep_kernels_lean

    keep_kernels_lean()
tell_of_compilation()
