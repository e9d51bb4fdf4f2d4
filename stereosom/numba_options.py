"""How inner loops are compiled: kept on disk, and free to run beside others. Needs numba."""

from numba import njit

# Divisions by zero are numpy's: they give infinity, and are not looked for at each of them.
compiled = njit(cache=True, nogil=True, error_model="numpy")
