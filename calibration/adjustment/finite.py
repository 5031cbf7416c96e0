"""Which rows of a table hold numbers only."""

from __future__ import annotations

import numpy as np

from geometry.arrays import Bools, Floats


def finite_rows(values: Floats) -> Bools:
    """Rows (n,) of ``values`` (n, k) without NaN or infinity."""
    return np.asarray(np.isfinite(values).all(axis=-1), dtype=np.bool_)
