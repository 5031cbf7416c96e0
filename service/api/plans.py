"""``/v1/plans``: what holds the cameras of a design, to be cut, drilled and aimed."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Response
from pydantic import Field

from rig.build.mounts.systemfile import SystemFile, system_from_mapping
from service.api.context import ServiceDep
from service.api.designs import resource as designs
from service.api.job_routes import JobResource
from service.api.measuring import Id, completed, made_file
from service.api.models import LARGEST_JSON_INTEGER, IdempotencyKeyHeader, Job, Model, problems
from service.api.submission import submit
from service.api.zipped import ZIP, zipped

JSON = dict[str, Any]
router = APIRouter(tags=["plans"])


class PlanRequest(Model):
    """What to plan: a mount for the cameras of a design."""

    design_id: Id
    mount: Annotated[SystemFile, Field(description="The structure of a system file, as JSON.")]
    name: Annotated[str, Field(max_length=100, description="What to call it.")] = ""
    seed: Annotated[
        int, Field(ge=0, le=LARGEST_JSON_INTEGER, description="Of the trials of tolerances.")
    ] = 0
    paper: Annotated[Literal["A4", "A3"], Field(description="Of drilling templates.")] = "A4"


class PlanNetwork(Model):
    """What a network of poses is worth."""

    sigma_median_mm: float | None
    sigma_p95_mm: float | None
    coverage_2_views: float
    coverage_3_views: float
    feasible: bool
    broken: list[str]


class PlanPrice(Model):
    """What building costs: as designed, rounded one by one, and re-optimised."""

    designed: PlanNetwork
    rounded: PlanNetwork
    built: PlanNetwork
    sigma_loss: Annotated[float | None, Field(description="Share of the median sigma.")]
    coverage_loss: Annotated[float | None, Field(description="Share of points with two views.")]


class PlanClash(Model):
    """Two things that overlap, or one that stands in a view."""

    kind: str
    one: str
    other: str
    clearance_mm: float | None
    required_mm: float | None


class PlanTolerance(Model):
    """How far a setting may be off, alone; null: farther than was tried."""

    camera: str
    setting: str
    unit: str
    plus: float | None
    minus: float | None
    limit: str


class PlanSetting(Model):
    """One figure to set. ``step`` 0: made to the figure."""

    name: str
    value: float
    unit: str
    step: float


class PlanCamera(Model):
    """How one camera is set."""

    name: str
    settings: list[PlanSetting]


class PlanResult(Model):
    """A plan in short; its files hold the rest."""

    name: str
    system: str
    buildable: Annotated[bool, Field(description="Whether nothing clashes.")]
    clashes: list[PlanClash]
    price: PlanPrice
    yield_share: Annotated[
        float | None, Field(description="Share of rigs built with small errors that keep limits.")
    ]
    yield_trials: int
    tightest: Annotated[
        list[PlanTolerance], Field(description="Of each kind of setting the tightest.")
    ]
    members: int
    member_length_mm: float
    plates: int
    wedges: int
    parts: int
    cameras: list[PlanCamera]
    steps: Annotated[list[str], Field(description="How to put it together, in order.")]
    notes: list[str]


class PlanJob(Job[PlanResult]):
    """A plan: pending, running, or ended."""


class PlanPage(Model):
    """Plans, newest first. ``next`` is the cursor of the next page, null on the last."""

    items: list[PlanJob]
    next: int | None


resource = JobResource("plan", "plans", PlanJob, PlanPage)


@router.post(
    resource.path,
    status_code=201,
    response_model=PlanJob,
    responses=problems(400, 404, 409, 413, 422, 503, 507),
)
def add_plan(
    request: PlanRequest,
    response: Response,
    service: ServiceDep,
    idempotency_key: IdempotencyKeyHeader = None,
) -> JSON:
    """Ask for a mount plan of a completed design. The design's scan must still be here."""
    design = completed(service, request.design_id, designs.kind)
    scan = service.store.scans.get(design.scan_id or "")
    mount = request.mount.model_dump(mode="json", by_alias=True, exclude_unset=True)
    system_from_mapping(mount)
    file = made_file(service, request.design_id, designs.kind, "design.json", "design")
    content = {
        "mount": mount,
        "name": request.name,
        "seed": request.seed,
        "paper": request.paper,
        "step": False,
    }
    return submit(service, resource, content, idempotency_key, response, scan=scan, inputs=(file,))


@router.get(
    resource.path + "/{job_id}/archive", response_class=Response, responses=problems(404, 409) | ZIP
)
def read_archive(service: ServiceDep, job_id: str) -> Response:
    """Fetch all files of a plan in one ZIP archive."""
    completed(service, job_id, resource.kind)
    files = {file.name: file.path.read_bytes() for file in service.store.jobs.files(job_id)}
    return zipped(files, "plan.zip")


resource.add_to(router)
resource.add_shortcut(router, "plan", "plan.json", "application/json")
resource.add_shortcut(router, "report", "plan.html", "text/html")
