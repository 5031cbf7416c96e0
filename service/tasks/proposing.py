"""Targets for a rig, from its design file alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from calibration.targets.proposing import Proposal, propose_targets
from common.errors import InputError
from rig.design.designfile import read_design
from service.kinds.targets import SeenByCamera

HEAD_MM = (160.0, 200.0, 240.0)
"""Width, depth and height of what a face is a part of: targets stand round the whole head."""


def proposal_for(design: Path) -> Proposal:
    """Targets for a designed rig; its region tells where the subject is.

    Raises :class:`InputError` for a design file without points.
    """
    read = read_design(design)
    if read.file.points is None or not read.file.points.position_mm:
        raise InputError(
            "design-without-points",
            f"{design.name} does not say where the subject is",
            "give a design.json that `rigwright design` wrote",
        )
    points = np.array(read.file.points.position_mm)
    low, high = points.min(axis=0), points.max(axis=0)
    size = np.maximum(high - low, HEAD_MM)
    centre = (low + high) / 2.0
    # The region is the front of the head: what is behind it reaches backwards only.
    centre[1] = low[1] + size[1] / 2.0
    return propose_targets(read.cameras, centre, size, name=f"targets for {read.name}")


def seen_by_cameras(proposal: Proposal) -> list[SeenByCamera]:
    """What each camera sees of a proposal."""
    return [
        SeenByCamera(
            camera=seen.camera,
            targets=int(seen.targets),
            cells=int(seen.cells),
            radius_px=(float(seen.radius_px[0]), float(seen.radius_px[1])),
        )
        for seen in proposal.cameras
    ]
