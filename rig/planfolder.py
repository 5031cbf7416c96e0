"""The plan folder: everything a builder needs, written whole or not at all."""

from __future__ import annotations

import hashlib
import io
import json
import secrets
import shutil
import zipfile
from collections.abc import Mapping
from pathlib import Path

from geometry.errors import CancelledError, ConflictError, InputError
from rig.mounts.plan import MountPlan
from rig.planfiles import PlanFile, PlanOptions, plan_files
from solver.progress import CancelToken, NeverCancelled, Progress, ProgressCallback, ignore_progress

MANIFEST = "manifest.json"
SCHEMA = "rigwright.plan-files/1"
ZIP_TIME = (1980, 1, 1, 0, 0, 0)


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
    half = out.parent / f".{out.name}.{secrets.token_hex(4)}.part"
    try:
        half.mkdir(parents=True)
        _write_all(half, list(files.values()), progress, stop)
        _put_in_place(half, out)
    except OSError as error:
        raise InputError(
            "out-unwritable",
            f"cannot write to {out} ({(error.strerror or 'unwritable').lower()})",
            "choose another --out folder",
        ) from error
    finally:
        shutil.rmtree(half, ignore_errors=True)
    return {name: out / name for name in (*files, MANIFEST)}


def _write_all(
    half: Path, files: list[PlanFile], progress: ProgressCallback, stop: CancelToken
) -> None:
    entries = []
    for done, file in enumerate(files):
        if stop.is_set():
            raise CancelledError
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


def plan_zip(files: Mapping[str, PlanFile]) -> bytes:
    """All files in one ZIP archive, with their manifest; equal files give an equal archive."""
    stream = io.BytesIO()
    entries = []
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in files.values():
            data = file.make()
            archive.writestr(zipfile.ZipInfo(file.name, ZIP_TIME), data, zipfile.ZIP_DEFLATED)
            entries.append(_entry(file, data))
        text = json.dumps({"schema": SCHEMA, "files": entries}, indent=1, ensure_ascii=False) + "\n"
        archive.writestr(zipfile.ZipInfo(MANIFEST, ZIP_TIME), text, zipfile.ZIP_DEFLATED)
    return stream.getvalue()


def check_plan_folder(out: Path) -> None:
    """Raise when a plan cannot be written to ``out``; call it before a long calculation."""
    if out.is_dir():
        found = {p.relative_to(out).as_posix() for p in out.rglob("*") if not p.is_dir()}
        others = sorted(found - _listed(out))
        if others:
            raise ConflictError(
                "out-not-empty",
                f"the folder {out} holds other files ({others[0]})",
                "choose an empty or new folder",
            )
    elif out.exists() or out.is_symlink():
        raise ConflictError("out-not-a-folder", f"{out} is not a folder", "choose another place")


def _listed(out: Path) -> set[str]:
    """Files of the plan that a folder holds, by its manifest; none when it has no sound one."""
    try:
        document = json.loads((out / MANIFEST).read_text("utf-8"))
        if document["schema"] != SCHEMA:
            return set()
        return {str(entry["name"]) for entry in document["files"]} | {MANIFEST}
    except (OSError, ValueError, KeyError, TypeError):
        return set()


def _put_in_place(half: Path, out: Path) -> None:
    """Rename ``half`` to ``out``; a former plan steps aside first and goes last."""
    former = half.with_suffix(".old")
    if out.exists():
        out.rename(former)
    try:
        half.rename(out)
    except OSError:
        if former.exists():
            former.rename(out)
        raise
    shutil.rmtree(former, ignore_errors=True)
