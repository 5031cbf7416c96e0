"""Array aliases. The shape of each array stands in the docstring of its owner."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def frozen(values: object) -> Floats:
    """A read-only float64 copy of ``values``, so that frozen objects stay frozen."""
    copy = np.array(values, dtype=np.float64)
    copy.setflags(write=False)
    return copy


def frozen_ints(values: object) -> Ints:
    """A read-only int64 copy of ``values``."""
    copy = np.array(values, dtype=np.int64)
    copy.setflags(write=False)
    return copy
