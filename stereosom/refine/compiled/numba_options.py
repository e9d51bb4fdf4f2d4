"""How the loops are compiled: kept on disk, and free to run beside others."""

from numba import njit

compiled = njit(cache=True, fastmath=False, nogil=True)
