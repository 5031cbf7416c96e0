"""Rigs of requests, together with what was said of the scan they are for."""

from __future__ import annotations

from collections.abc import Mapping

from rig.specification.rigfile import RigFile


def rig_for_scan(rig: RigFile, options: Mapping[str, str | float]) -> RigFile:
    """The rig, read with the scan's own ``options`` where it has none.

    Raises :class:`~common.errors.InputError` when the whole makes no sense.
    """
    own = rig.scan.model_dump(exclude_unset=True)
    told = {key: value for key, value in own.items() if value not in (None, "auto")}
    section = rig.scan.model_validate({**options, **told})
    return rig.model_copy(update={"scan": section})
