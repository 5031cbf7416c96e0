"""The plan folder: everything a builder needs, written whole or not at all."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

from common.files.folders import refuse_others, whole_folder
from common.files.reading import json_in
from common.progress import (
    CancelToken,
    NeverCancelled,
    Progress,
    ProgressCallback,
    go_on,
    ignore_progress,
)
from rig.build.folder.planfiles import PlanFile, PlanOptions, plan_files
from rig.build.mounts.plan import MountPlan

MANIFEST = "manifest.json"
SCHEMA = "rigwright.plan-files/1"


def write_plan(
    plan: MountPlan,
    out: Path,
    options: PlanOptions | None = None,
    *,
    progress: ProgressCallback = ignore_progress,
    cancel: CancelToken | None = None,
) -> dict[str, Path]:
    """Write all files of a plan to the folder ``out``; returns their paths by name.

    The files are written to a folder beside it that is then renamed, so ``out`` never holds half
    a plan. A former plan in ``out`` is replaced; a folder that holds anything else is a
    :class:`ConflictError`. :class:`CancelledError` when cancelled; nothing is left then.
    """
    check_plan_folder(out)
    files, stop = plan_files(plan, options), cancel or NeverCancelled()
    with whole_folder(out, check_plan_folder) as half:
        _write_all(half, list(files.values()), progress, stop)
    return {name: out / name for name in (*files, MANIFEST)}


def _write_all(
    half: Path, files: list[PlanFile], progress: ProgressCallback, stop: CancelToken
) -> None:
    entries = []
    for done, file in enumerate(files):
        go_on(stop)
        progress(Progress(f"writing {file.name}", done / len(files)))
        data = file.make()
        path = half / file.name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(data)
        entries.append(_entry(file, data))
    document = {"schema": SCHEMA, "files": entries}
    (half / MANIFEST).write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n", "utf-8")
    progress(Progress("written", 1.0))


def _entry(file: PlanFile, data: bytes) -> dict[str, str | int]:
    return {
        "name": file.name,
        "what": file.words,
        "media_type": file.media_type,
        "bytes": len(data),
        "sha256": hashlib.sha256(data).hexdigest(),
    }


def check_plan_folder(out: Path) -> None:
    """Raise when a plan cannot be written to ``out``; call it before a long calculation."""
    refuse_others(out, _listed(out))


def _listed(out: Path) -> set[str]:
    """Files of the plan that a folder holds, by its manifest; none when it has no sound one."""
    try:
        document = json_in(out / MANIFEST)
        if document["schema"] != SCHEMA:
            return set()
        return {str(entry["name"]) for entry in document["files"]} | {MANIFEST}
    except (OSError, ValueError, KeyError, TypeError):
        return set()
