"""``/v1/target-sets``: coded targets, to be printed and to be found in pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated
from urllib.parse import quote

from fastapi import APIRouter, Query, Response
from pydantic import AwareDatetime, Field

from common.errors import NotFoundError
from service.api.addresses import at
from service.api.context import Service, ServiceDep
from service.api.designs import resource as designs
from service.api.models import Cursor, Limit, problems
from service.api.responses import a_file
from service.kinds.base import Id, Model
from service.kinds.defaults import PAGE
from service.kinds.targets import SeenByCamera, TargetsModel
from service.store.documents import DocumentRecord
from service.tasks.targetsets import (
    TargetFile,
    given_targets,
    proposed_targets,
    read_target_text,
    sheets_of_file,
)

KIND = "target-set"
PATH = "/v1/target-sets"
router = APIRouter(tags=["target sets"])
Page = Annotated[
    str, Query(max_length=40, description="A4, A3, letter, 'A4 landscape', or 600x400 in mm.")
]


class TargetSet(Model):
    """A target set. The same content is the same target set."""

    id: str
    name: str
    created_at: AwareDatetime
    targets: int
    carriers: Annotated[dict[str, int], Field(description="Number of targets by carrier.")]
    links: dict[str, str]


class TargetSetPage(Model):
    """Target sets, newest first. ``next`` is the cursor of the next page, null on the last."""

    items: list[TargetSet]
    next: int | None


class TargetText(Model):
    """A target file: what it is called, and what it says."""

    name: Annotated[str, Field(min_length=1, max_length=200)]
    text: Annotated[str, Field(max_length=1_000_000, description="TOML.")]


class ProposalRequest(Model):
    """Whom to propose targets for."""

    design_id: Id


class ProposedTargets(Model):
    """A target set for a rig, and what its cameras see of it."""

    target_set: TargetSet
    cameras: list[SeenByCamera]
    notes: list[str]


class SheetEntry(Model):
    """A file made of a target set."""

    name: str
    carrier: str
    media_type: str
    href: str


class SheetList(Model):
    """All files made of a target set."""

    items: list[SheetEntry]


def _document(record: DocumentRecord) -> TargetSet:
    own = at(f"{PATH}/{record.id}")
    return TargetSet(
        id=record.id,
        name=record.report["name"],
        created_at=record.created_at,  # type: ignore[arg-type]
        targets=sum(record.report["carriers"].values()),
        carriers=record.report["carriers"],
        links={"self": own, "file": f"{own}/file", "sheets": f"{own}/sheets"},
    )


def keep_targets(service: Service, targets: TargetFile) -> tuple[DocumentRecord, bool]:
    """Put a target set into the store; the flag tells whether it is new."""
    report = {"name": targets.name, "carriers": dict(targets.carriers)}
    with service.store.files.stage(".toml") as staging:
        staging.write(targets.text.encode())
        return service.store.documents.add(KIND, staging.finish(), "targets.toml", report)


@router.post(
    PATH,
    status_code=201,
    response_model=TargetSet,
    responses=problems(400, 413, 422, 507)
    | {200: {"model": TargetSet, "description": "The target set was here already."}},
)
def add_target_set(request: TargetsModel, response: Response, service: ServiceDep) -> TargetSet:
    """Add a target set: the structure of a target file, as JSON."""
    return _added(service, given_targets(request), response)


@router.post(
    "/v1/target-files",
    status_code=201,
    response_model=TargetSet,
    responses=problems(400, 413, 422, 507)
    | {200: {"model": TargetSet, "description": "The target set was here already."}},
)
def add_target_file(request: TargetText, response: Response, service: ServiceDep) -> TargetSet:
    """Add a target set as a target file says it."""
    return _added(service, read_target_text(request.text, request.name), response)


def _added(service: Service, targets: TargetFile, response: Response) -> TargetSet:
    record, new = keep_targets(service, targets)
    response.status_code = 201 if new else 200
    response.headers["Location"] = at(f"{PATH}/{record.id}")
    return _document(record)


@router.post(
    "/v1/target-set-proposals",
    status_code=201,
    response_model=ProposedTargets,
    responses=problems(400, 404, 409, 413, 422, 507),
)
def propose_target_set(
    request: ProposalRequest, response: Response, service: ServiceDep
) -> ProposedTargets:
    """Add a target set that suits a design: sizes, numbers and places for its cameras."""
    proposal = proposed_targets(Path(designs.file(service, request.design_id, "design.json").path))
    record, _ = keep_targets(service, proposal.targets)
    response.headers["Location"] = at(f"{PATH}/{record.id}")
    return ProposedTargets(
        target_set=_document(record),
        cameras=list(proposal.cameras),
        notes=list(proposal.notes),
    )


@router.get(PATH, response_model=TargetSetPage, responses=problems(422))
def list_target_sets(
    service: ServiceDep, limit: Limit = 50, cursor: Cursor = None
) -> TargetSetPage:
    """List target sets, newest first."""
    found = service.store.documents.page(KIND, limit + 1, cursor)
    shown = found[:limit]
    return TargetSetPage(
        items=[_document(record) for record in shown],
        next=shown[-1].seq if len(found) > limit else None,
    )


@router.get(PATH + "/{target_set_id}", response_model=TargetSet, responses=problems(404))
def read_target_set(service: ServiceDep, target_set_id: str) -> TargetSet:
    """Read what a target set holds."""
    return _document(service.store.documents.get(KIND, target_set_id))


@router.get(
    PATH + "/{target_set_id}/file",
    response_class=Response,
    responses=problems(404) | a_file("application/toml", description="The target file."),
)
def read_target_file(service: ServiceDep, target_set_id: str) -> Response:
    """Fetch a target set as a target file (TOML)."""
    record = service.store.documents.get(KIND, target_set_id)
    content = service.store.documents.path(record).read_bytes()
    return Response(content, media_type="application/toml")


@router.get(
    PATH + "/{target_set_id}/sheets", response_model=SheetList, responses=problems(404, 422)
)
def list_sheets(service: ServiceDep, target_set_id: str, page: Page = PAGE) -> SheetList:
    """List what can be printed, and the pictures for simulations."""
    items = [
        SheetEntry(
            name=sheet.name,
            carrier=sheet.carrier,
            media_type=sheet.media_type,
            href=at(f"{PATH}/{target_set_id}/sheets/{quote(sheet.name)}"),
        )
        for sheet in sheets_of_file(target_file(service, target_set_id), page).values()
    ]
    return SheetList(items=items)


@router.get(
    PATH + "/{target_set_id}/sheets/{name}",
    response_class=Response,
    responses=problems(404, 422) | a_file("application/pdf", "image/svg+xml", "image/png"),
)
def read_sheet(service: ServiceDep, target_set_id: str, name: str, page: Page = PAGE) -> Response:
    """Fetch a sheet to print (PDF, SVG), or a picture of a carrier for simulations (PNG)."""
    sheets = sheets_of_file(target_file(service, target_set_id), page)
    if name not in sheets:
        raise NotFoundError(
            "file", f"the target set has no sheet {name!r}", f"see {PATH}/{target_set_id}/sheets"
        )
    return Response(sheets[name].make(), media_type=sheets[name].media_type)


@router.delete(PATH + "/{target_set_id}", status_code=204, responses=problems(404))
def remove_target_set(service: ServiceDep, target_set_id: str) -> None:
    """Remove a target set. Calibrations and checks made with it stay."""
    service.store.documents.remove(KIND, target_set_id)


def target_file(service: Service, target_set_id: str) -> Path:
    """The target file of a set. Raises :class:`NotFoundError`."""
    documents = service.store.documents
    return documents.path(documents.get(KIND, target_set_id))
