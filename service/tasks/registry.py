"""Which function does which kind of job.

Each is imported when it is asked for: reading a scan must not wait until the solver and OpenCV
are loaded.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from common.errors import InternalError
from service.jobs.engine import Work


def _design() -> Work[Any, Any]:
    from service.kinds.design import DESIGN
    from service.tasks.designing import design

    return Work(DESIGN, design)


def _demo() -> Work[Any, Any]:
    from service.kinds.design import DEMO
    from service.tasks.designing import demo

    return Work(DEMO, demo)


def _evaluation() -> Work[Any, Any]:
    from service.kinds.evaluation import EVALUATION
    from service.tasks.designing import evaluation

    return Work(EVALUATION, evaluation)


def _plan() -> Work[Any, Any]:
    from service.kinds.plan import PLAN
    from service.tasks.planning import plan

    return Work(PLAN, plan)


def _targets() -> Work[Any, Any]:
    from service.kinds.targets import TARGETS
    from service.tasks.targeting import targets

    return Work(TARGETS, targets)


def _calibration() -> Work[Any, Any]:
    from service.kinds.calibration import CALIBRATION
    from service.tasks.calibrating import calibration

    return Work(CALIBRATION, calibration)


def _check() -> Work[Any, Any]:
    from service.kinds.check import CHECK
    from service.tasks.calibrating import rig_check

    return Work(CHECK, rig_check)


def _acceptance() -> Work[Any, Any]:
    from service.kinds.acceptance import ACCEPTANCE
    from service.tasks.calibrating import acceptance

    return Work(ACCEPTANCE, acceptance)


def _reconstruction() -> Work[Any, Any]:
    from service.kinds.reconstruction import RECONSTRUCTION
    from service.tasks.reconstructing import reconstruction

    return Work(RECONSTRUCTION, reconstruction)


def _comparison() -> Work[Any, Any]:
    from service.kinds.comparison import COMPARISON
    from service.tasks.comparing import comparison

    return Work(COMPARISON, comparison)


def _trial() -> Work[Any, Any]:
    from service.kinds.trial import TRIAL
    from service.tasks.trying import trial

    return Work(TRIAL, trial)


def _recognition_training() -> Work[Any, Any]:
    from service.kinds.recognition import TRAINING
    from service.tasks.recognising import training

    return Work(TRAINING, training)


def _recognition_enrolment() -> Work[Any, Any]:
    from service.kinds.recognition import ENROLMENT
    from service.tasks.recognising import enrolment

    return Work(ENROLMENT, enrolment)


def _recognition_verification() -> Work[Any, Any]:
    from service.kinds.recognition import VERIFICATION
    from service.tasks.recognising import verification

    return Work(VERIFICATION, verification)


def _study() -> Work[Any, Any]:
    from service.kinds.study import STUDY
    from service.tasks.studying import study

    return Work(STUDY, study)


def _scan_import() -> Work[Any, Any]:
    from service.kinds.imports import SCAN_IMPORT
    from service.tasks.reading import import_scan

    return Work(SCAN_IMPORT, import_scan)


def _pictures_import() -> Work[Any, Any]:
    from service.kinds.imports import PICTURES_IMPORT
    from service.tasks.picturing import import_pictures

    return Work(PICTURES_IMPORT, import_pictures)


_WORK: dict[str, Callable[[], Work[Any, Any]]] = {
    "design": _design,
    "demo": _demo,
    "evaluation": _evaluation,
    "plan": _plan,
    "targets": _targets,
    "calibration": _calibration,
    "check": _check,
    "acceptance": _acceptance,
    "reconstruction": _reconstruction,
    "comparison": _comparison,
    "trial": _trial,
    "recognition-training": _recognition_training,
    "recognition-enrolment": _recognition_enrolment,
    "recognition-verification": _recognition_verification,
    "study": _study,
    "scan-import": _scan_import,
    "picture-import": _pictures_import,
}

KIND_NAMES = tuple(_WORK)
"""All kinds that have work."""


def work_of(kind: str) -> Work[Any, Any]:
    """The work of a kind of job, by its name. Raises :class:`InternalError` for none."""
    if kind not in _WORK:
        raise InternalError("job-kind", f"there is no work for {kind!r} jobs", "report this fault")
    return _WORK[kind]()
