"""Target sets: printed, or proposed for a rig and printed."""

from __future__ import annotations

import shutil

from calibration.targets.boards import AprilGrid, Chessboard, DotGrid
from calibration.targets.files import read_targets, write_targets
from calibration.targets.kinds import CharucoPlate, MarkerCarrier, RingCarrier, TargetPlan
from common.errors import CancelledError
from common.progress import Progress
from service.jobs.engine import Running, Task
from service.kinds.targets import CarrierLine, SeenByCamera, TargetsRequest, TargetsResult
from service.tasks.proposing import proposal_for, seen_by_cameras
from service.tasks.sheets import sheets_of


def targets(task: Task[TargetsRequest, TargetsResult], running: Running) -> TargetsResult:
    """Write ``targets.toml`` and every sheet of a set.

    That is the input ``targets``, or one for the input ``design``.
    """
    cameras: list[SeenByCamera] = []
    notes: list[str] = []
    if "design" in task.inputs:
        proposal = proposal_for(task.inputs["design"])
        plan, cameras, notes = proposal.plan, seen_by_cameras(proposal), list(proposal.notes)
        write_targets(plan, task.folder / "targets.toml")
    else:
        plan = read_targets(task.inputs["targets"])
        # As it was given: with what somebody noted in it.
        shutil.copyfile(task.inputs["targets"], task.folder / "targets.toml")
    sheets = sheets_of(plan, task.request.page)
    for number, sheet in enumerate(sheets.values()):
        if running.cancel.is_set():
            raise CancelledError
        running.report(Progress(f"drawing {sheet.name}", number / len(sheets)))
        (task.folder / sheet.name).write_bytes(sheet.make())
    running.report(Progress("done", 1.0))
    return TargetsResult(name=plan.name, carriers=_carriers(plan), cameras=cameras, notes=notes)


_KINDS = {
    CharucoPlate: "ChArUco plate",
    Chessboard: "chessboard",
    AprilGrid: "AprilGrid",
    DotGrid: "dot grid",
    MarkerCarrier: "square markers",
    RingCarrier: "ring-coded targets",
}


def _carriers(plan: TargetPlan) -> list[CarrierLine]:
    return [
        CarrierLine(name=c.name, kind=_KINDS[type(c)], targets=len(c.ids)) for c in plan.carriers
    ]
