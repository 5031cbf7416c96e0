"""``/v1/rigs/{rig}/cameras/{camera}/preview``: what cameras see between captures."""

from __future__ import annotations

from typing import Annotated
from urllib.parse import quote

from fastapi import APIRouter, Query, Response

from common.errors import ConflictError, InputError
from service.api.context import ServiceDep
from service.api.models import problems
from service.api.responses import Responses, a_file
from service.api.rigs import rig_path
from service.api.targetsets import target_file
from service.stations.liveview import Asked, LiveLook, live_jpeg, live_look

router = APIRouter(tags=["rigs"])
_PATH = "/v1/rigs/{rig}/cameras/{camera}/preview"
Share = Annotated[float | None, Query(ge=0.0, le=1.0, allow_inf_nan=False)]
_RESTING: Responses = {204: {"description": "The rig is at work: ask again when it has ended."}}


def _resting(error: ConflictError) -> Response:
    """No fault of whoever looks: a capture goes first, and a page shows no error for it."""
    if error.detail != "rig-busy":
        raise error
    return Response(status_code=204, headers={"Retry-After": "1"})


def preview_path(rig: str, camera: str) -> str:
    """Where what a camera sees can be looked at."""
    return f"{rig_path(rig)}/cameras/{quote(camera, safe='')}/preview"


@router.get(_PATH, response_model=LiveLook, responses=problems(404, 409, 422, 503) | _RESTING)
def read_preview(
    service: ServiceDep,
    rig: str,
    camera: str,
    target_set_id: Annotated[
        str | None, Query(description="Look for these targets; one of them stands at the datum.")
    ] = None,
    x: Annotated[
        Share, Query(description="Where the datum is seen, as a share of the width.")
    ] = None,
    y: Annotated[Share, Query(description="And of the height.")] = None,
) -> LiveLook | Response:
    """Look through a camera: how sharp, how exposed, and how to turn it towards the datum.

    Takes no capture. 204 while the rig is busy: a live view is never in the way of one. Whoever
    asks sooner than after 0.4 s is shown the same picture again.
    """
    if (x is None) != (y is None):
        raise InputError("preview-place", "of x and y one is missing", "give both, or neither")

    open_rig = service.rigs.get(rig).open_rig(camera)
    targets = target_file(service, target_set_id) if target_set_id else None
    asked = Asked(targets, None if x is None or y is None else (x, y))
    try:
        look = live_look(open_rig, camera, asked)
    except ConflictError as error:
        return _resting(error)
    own = preview_path(rig, camera)
    links = {"self": own, "picture": f"{own}.jpg?number={look.number}"}
    return look.model_copy(update={"links": links})


@router.get(
    _PATH + ".jpg",
    response_class=Response,
    responses=problems(404, 409, 422, 503)
    | a_file("image/jpeg", description="A small picture.")
    | _RESTING,
)
def read_preview_picture(
    service: ServiceDep,
    rig: str,
    camera: str,
    number: Annotated[
        int | None, Query(ge=1, description="Of the look that the picture belongs to.")
    ] = None,
) -> Response:
    """Fetch what a camera sees, at most 960 pixels wide and high; a dark one is brightened."""
    try:
        data = live_jpeg(service.rigs.get(rig).open_rig(camera), camera, number)
    except ConflictError as error:
        return _resting(error)
    return Response(data, media_type="image/jpeg", headers={"Cache-Control": "no-store"})
