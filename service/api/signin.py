"""``/v1/sign-in``: who asks, and the cookie that a browser shows instead of a key."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Request, Response
from pydantic import AwareDatetime, Field

from common.errors import RigwrightError
from service.api.addresses import at
from service.api.context import ServiceDep
from service.api.door import COOKIE, VISITOR, address_of, who_asks
from service.api.models import problems
from service.keys.ring import SIGNED_IN_FOR, Visitor
from service.keys.scope import Scope
from service.kinds.base import Model

router = APIRouter(tags=["service"])


class SignInRequest(Model):
    """A key, as `rigwright keys add` showed it."""

    key: Annotated[str, Field(min_length=1, max_length=200)]


class SignedIn(Model):
    """Who asks and what they may do: no scope before a key was shown.

    Where the service asks for no keys everybody may do everything, and has no name.
    """

    name: str | None
    scope: Scope | None
    until: AwareDatetime | None


_EVERYBODY = SignedIn(name=None, scope=Scope.HARDWARE, until=None)


@router.get("/v1/sign-in", response_model=SignedIn)
def read_sign_in(request: Request, service: ServiceDep) -> SignedIn:
    """Read who asks, and what they may do. Answered without a key too."""
    if service.keys is None:
        return _EVERYBODY
    try:
        return _document(who_asks(service.keys, request.scope))
    except RigwrightError:
        return SignedIn(name=None, scope=None, until=None)


@router.post(
    "/v1/sign-in",
    response_model=SignedIn,
    responses=problems(400, 401, 413, 422, 429),
)
def sign_in(
    given: SignInRequest, request: Request, response: Response, service: ServiceDep
) -> SignedIn:
    """Show a key and get a cookie, for 16 hours at most, that only the service's own page sends.

    Where the service asks for no keys nothing is looked at, and no cookie is set.
    """
    if service.keys is None:
        return _EVERYBODY
    visitor, token = service.keys.sign_in(given.key, address_of(request.scope))
    request.scope[VISITOR] = visitor
    _set_cookie(request, response, token, round(SIGNED_IN_FOR.total_seconds()))
    return _document(visitor)


@router.delete("/v1/sign-in", status_code=204)
def sign_out(request: Request, response: Response, service: ServiceDep) -> None:
    """End the sign-in that the cookie stands for."""
    visitor = request.scope.get(VISITOR)
    if service.keys is not None and visitor is not None:
        service.keys.sign_out(visitor)
    _set_cookie(request, response, "", 0)


def _set_cookie(request: Request, response: Response, token: str, seconds: int) -> None:
    response.set_cookie(
        COOKIE,
        token,
        max_age=seconds,
        path=at("/"),
        secure=request.url.scheme == "https",
        httponly=True,
        samesite="strict",
    )


def _document(visitor: Visitor) -> SignedIn:
    return SignedIn(name=visitor.key.name, scope=visitor.key.scope, until=visitor.until)
