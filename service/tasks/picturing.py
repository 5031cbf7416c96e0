"""Looks into an uploaded archive of pictures. Apart from the tasks that load OpenCV."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from common.progress import CancelToken, ProgressCallback
from service.pictures.archive import archive_facts


def import_pictures(
    request: Mapping[str, Any],
    inputs: Mapping[str, Path],
    folder: Path,
    report: ProgressCallback,
    cancel: CancelToken,
) -> dict[str, Any]:
    """Tell which pictures are in an archive."""
    del request, folder, report, cancel
    return archive_facts(inputs["upload"])
