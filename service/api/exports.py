"""``/v1/designs/{id}/exports``: a design's cameras for other programs."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import Any

from fastapi import APIRouter, Response

from geometry.exchange import FORMATS, export_files
from rig.designfile import read_design
from service.api.context import ServiceDep
from service.api.designs import resource
from service.api.models import Model, problems

JSON = dict[str, Any]
router = APIRouter(tags=["designs"])
_NO_TIME = (1980, 1, 1, 0, 0, 0)
"""The same design gives the same bytes."""


class ExportFormat(Model):
    """One way to write the cameras."""

    name: str
    program: str
    description: str
    href: str


class ExportList(Model):
    """All formats."""

    items: list[ExportFormat]


@router.get(resource.path + "/{job_id}/exports", response_model=ExportList, responses=problems(404))
def list_exports(service: ServiceDep, job_id: str) -> JSON:
    """List the programs a design's cameras can be written for."""
    service.store.jobs.get(job_id, resource.kind)
    items = [
        {
            "name": form.name,
            "program": form.program,
            "description": form.description,
            "href": f"{resource.path}/{job_id}/exports/{form.name}",
        }
        for form in FORMATS.values()
    ]
    return {"items": items}


@router.get(
    resource.path + "/{job_id}/exports/{form}",
    response_class=Response,
    responses=problems(404, 409, 503)
    | {200: {"description": "The files, as a ZIP archive.", "content": {"application/zip": {}}}},
)
def read_export(service: ServiceDep, job_id: str, form: str) -> Response:
    """Fetch a design's cameras as one program wants them, in a ZIP archive."""
    design = resource.file(service, job_id, "design.json")
    files = export_files(form, read_design(Path(design.path)).cameras)
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(zipfile.ZipInfo(name, _NO_TIME), content)
    headers = {"Content-Disposition": f'attachment; filename="{form}.zip"'}
    return Response(packed.getvalue(), media_type="application/zip", headers=headers)
