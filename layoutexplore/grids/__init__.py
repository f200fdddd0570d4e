"""The bottom drawer: occupancy grids and the primitives on them, each once."""

import contextlib

from layoutexplore.processes.compilation import tell_of_compilation

# A numba that has its code elsewhere keeps kernels in its own ways, with more memory.
with contextlib.suppress(ImportError):
    from layoutexplore.processes.kernel_memory import keep_kernels_lean

    keep_kernels_lean()
with contextlib.suppress(ImportError):
    from layoutexplore.processes.kernel_files import keep_kernels_apart

    keep_kernels_apart()
with contextlib.suppress(ImportError):
    from layoutexplore.processes.kernel_freshness import keep_kernels_fresh

    keep_kernels_fresh()
with contextlib.suppress(ImportError):
    from layoutexplore.processes.kernel_locks import compile_kernels_once

    compile_kernels_once()
tell_of_compilation()
