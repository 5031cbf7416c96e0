"""Looks into an uploaded archive of pictures. Apart from the tasks that load OpenCV."""

from __future__ import annotations

from service.jobs.engine import Running, Task
from service.kinds.imports import PictureFacts, PicturesImportRequest
from service.pictures.archive import archive_facts


def import_pictures(
    task: Task[PicturesImportRequest, PictureFacts], running: Running
) -> PictureFacts:
    """Tell which pictures are in the input ``upload``."""
    del running
    return archive_facts(task.inputs["upload"])
