"""The conventional rig beside a design: as many of the same cameras side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from geometry.camera import RigCamera
from geometry.head import synthetic_head
from geometry.preparation import prepare_subject
from geometry.reading import read_scan
from rig.specification.examples import example_rig
from solver.beginnings import best_strip


def strip_beside(cameras: Sequence[RigCamera], head: Path | None) -> tuple[RigCamera, ...]:
    """The best of eleven strips before ``head`` by the face rig's limits, with these cameras.

    Without a head it is the bundled one.
    """
    spec = example_rig("face")
    scan = synthetic_head() if head is None else read_scan(head, spec.scan_options)
    prepared = prepare_subject(scan, replace(spec.subject_options, seed=spec.seed))
    names = tuple(camera.name for camera in cameras)
    return best_strip(prepared.subject, cameras[0].camera, spec.limits, names)
