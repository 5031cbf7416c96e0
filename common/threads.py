"""How many threads the linear algebra under NumPy takes."""

from __future__ import annotations

ONE_BLAS_THREAD = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "VECLIB_MAXIMUM_THREADS": "1",
}
"""Environment of whatever computes: matrices here are small, and threads that wait for one another
take several times as long. It is read when the library is loaded, so a process must begin with it.
"""
