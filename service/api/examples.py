"""``/v1/rig-examples`` and ``/v1/rig-schema``: rigs to begin with, and what a rig may say."""

from __future__ import annotations

from fastapi import APIRouter
from pydantic import JsonValue

from service.kinds.base import Model
from service.kinds.design import RigExample
from service.tasks.examples import example_rigs, rig_schema

router = APIRouter(tags=["designs"])


class RigExampleList(Model):
    """All of them."""

    items: list[RigExample]


@router.get("/v1/rig-examples", response_model=RigExampleList, response_model_exclude_unset=True)
def list_rig_examples() -> RigExampleList:
    """List rigs to begin with: change what differs, and send it with a design."""
    return RigExampleList(items=list(example_rigs()))


@router.get("/v1/rig-schema")
def read_rig_schema() -> dict[str, JsonValue]:
    """Read what a rig may say: the JSON schema (draft 2020-12) of a rig file."""
    return rig_schema()


def prepare() -> None:
    """Make once what all answers of this module are made of."""
    example_rigs()
    rig_schema()
