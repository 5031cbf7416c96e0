"""``/v1/rig-examples``: rigs to begin a design with."""

from __future__ import annotations

from fastapi import APIRouter

from service.kinds.base import Model
from service.kinds.design import RigExample
from service.tasks.examples import example_rigs

router = APIRouter(tags=["designs"])


class RigExampleList(Model):
    """All of them."""

    items: list[RigExample]


@router.get("/v1/rig-examples", response_model=RigExampleList, response_model_exclude_unset=True)
def list_rig_examples() -> RigExampleList:
    """List rigs to begin with: change what differs, and send it with a design."""
    return RigExampleList(items=list(example_rigs()))
