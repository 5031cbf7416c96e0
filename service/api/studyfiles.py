"""``/v1/study-files``: a study file with its rig files, as the request for a study that it is."""

from __future__ import annotations

from fastapi import APIRouter

from service.api.models import problems
from service.kinds.study import ReadStudy, StudyFiles
from service.tasks.studyfiles import read_study

router = APIRouter(tags=["studies"])


@router.post(
    "/v1/study-files",
    response_model=ReadStudy,
    response_model_exclude_unset=True,
    responses=problems(400, 413, 422),
)
def read_study_files(body: StudyFiles) -> ReadStudy:
    """Read a study file as the command does. Keeps nothing."""
    return read_study(body)
