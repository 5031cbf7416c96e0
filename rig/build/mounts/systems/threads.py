"""Whether studs go into holes, and what goes between where they do not."""

from __future__ import annotations

from common.errors import InputError
from geometry.camera import RigCamera
from rig.catalogue import Catalogue
from rig.catalogue.items import Fastener


def adapter_for(
    stud: str | None, hole: str | None, what: str, catalogue: Catalogue
) -> Fastener | None:
    """What joins a stud to a hole; None where they fit, or where one of them is not known.

    Raises :class:`InputError` where the catalogue has nothing that does; ``what`` says whose
    threads they are.
    """
    if stud is None or hole is None or stud == hole:
        return None
    for part in catalogue.fasteners.values():
        if part.kind == "adapter" and (part.inner_thread, part.thread) == (stud, hole):
            return part
    raise InputError(
        "mount-thread",
        f"a stud {stud} does not go into the hole {hole} of {what}, and the catalogue has no "
        "adapter",
        "add one in a file of your own, or choose another head or mount",
    )


def camera_thread(camera: RigCamera, catalogue: Catalogue) -> str | None:
    """The tripod thread of a camera; None where the catalogue does not say."""
    parts = catalogue.parts_of(camera.camera.name)
    return None if parts is None else parts[0].tripod_thread


def height_mm(adapter: Fastener | None) -> float:
    """What an adapter adds between the two parts."""
    return 0.0 if adapter is None else adapter.head_height_mm or 0.0


def counted(adapter: Fastener | None) -> dict[str, int]:
    """An adapter as what a joint is made with."""
    return {} if adapter is None else {adapter.id: 1}
