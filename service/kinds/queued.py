"""The kinds of jobs that wait in the service's queue."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from service.kinds.acceptance import ACCEPTANCE
from service.kinds.base import JobKind
from service.kinds.calibration import CALIBRATION
from service.kinds.check import CHECK
from service.kinds.comparison import COMPARISON
from service.kinds.design import DESIGN
from service.kinds.evaluation import EVALUATION
from service.kinds.plan import PLAN
from service.kinds.reconstruction import RECONSTRUCTION
from service.kinds.study import STUDY

_ALL: tuple[JobKind[Any, Any], ...] = (
    *(DESIGN, STUDY, EVALUATION, PLAN),
    *(CALIBRATION, CHECK, ACCEPTANCE),
    *(RECONSTRUCTION, COMPARISON),
)
QUEUED: Mapping[str, JobKind[Any, Any]] = {kind.name: kind for kind in _ALL}
"""By name."""
