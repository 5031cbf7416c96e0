"""``/v1/designs/{id}/exports``, ``/v1/calibrations/{id}/exports``: cameras for other programs."""

from __future__ import annotations

from pathlib import Path

from fastapi import APIRouter, Response

from service.api.addresses import at
from service.api.calibrations import resource as calibrations
from service.api.context import ServiceDep
from service.api.designs import resource as designs
from service.api.models import problems
from service.api.zipped import ZIP, zipped
from service.kinds.base import Model
from service.tasks.exporting import (
    calibrated_cameras,
    designed_cameras,
    export_formats,
    exported,
)

router = APIRouter(tags=["exports"])


class ExportFormat(Model):
    """One way to write the cameras."""

    name: str
    program: str
    description: str
    href: str


class ExportList(Model):
    """All formats."""

    items: list[ExportFormat]


@router.get(designs.path + "/{job_id}/exports", response_model=ExportList, responses=problems(404))
def list_design_exports(service: ServiceDep, job_id: str) -> ExportList:
    """List the programs a design's cameras can be written for."""
    service.store.jobs.get(job_id, designs.kind.name)
    return _formats(f"{designs.path}/{job_id}/exports")


@router.get(
    calibrations.path + "/{job_id}/exports", response_model=ExportList, responses=problems(404)
)
def list_calibration_exports(service: ServiceDep, job_id: str) -> ExportList:
    """List the programs calibrated cameras can be written for."""
    service.store.jobs.get(job_id, calibrations.kind.name)
    return _formats(f"{calibrations.path}/{job_id}/exports")


def _formats(path: str) -> ExportList:
    return ExportList(
        items=[
            ExportFormat(
                name=form.name,
                program=form.program,
                description=form.description,
                href=at(f"{path}/{form.name}"),
            )
            for form in export_formats()
        ]
    )


@router.get(
    designs.path + "/{job_id}/exports/{form}",
    response_class=Response,
    responses=problems(404, 409, 503) | ZIP,
)
def read_design_export(service: ServiceDep, job_id: str, form: str) -> Response:
    """Fetch a design's cameras as one program wants them, in a ZIP archive."""
    design = designs.file(service, job_id, "design.json")
    return zipped(exported(form, designed_cameras(Path(design.path))), f"{form}.zip")


@router.get(
    calibrations.path + "/{job_id}/exports/{form}",
    response_class=Response,
    responses=problems(404, 409, 422, 503) | ZIP,
)
def read_calibration_export(service: ServiceDep, job_id: str, form: str) -> Response:
    """Fetch calibrated cameras as one program wants them, in a ZIP archive.

    Where the calibration began from a design, pixel pitch and body are the design's.
    """
    file = calibrations.file(service, job_id, "calibration.json")
    built = service.store.jobs.inputs(job_id).get("design")
    cameras = calibrated_cameras(Path(file.path), None if built is None else built[1])
    return zipped(exported(form, cameras), f"{form}.zip")
