"""Target sets for the command line: printed, or proposed for a rig and printed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from calibration.targets.files import read_targets, write_targets
from calibration.targets.kinds import CharucoPlate, MarkerCarrier, RingCarrier, TargetPlan
from common.errors import CancelledError
from common.progress import CancelToken, Progress, ProgressCallback
from service.measuring.proposing import proposal_figures, proposal_for
from service.measuring.sheets import sheets_of

JSON = dict[str, Any]


def targets(
    request: Mapping[str, Any],
    inputs: Mapping[str, Path],
    folder: Path,
    report: ProgressCallback,
    cancel: CancelToken,
) -> JSON:
    """Write ``targets.toml`` and every sheet of the set given, or of one for the design given."""
    proposed: JSON = {"cameras": [], "notes": []}
    if "design" in inputs:
        proposal = proposal_for(inputs["design"])
        plan, proposed = proposal.plan, proposal_figures(proposal)
    else:
        plan = read_targets(inputs["targets"])
    write_targets(plan, folder / "targets.toml")
    sheets = sheets_of(plan, request["page"])
    for number, sheet in enumerate(sheets.values()):
        if cancel.is_set():
            raise CancelledError
        report(Progress(f"drawing {sheet.name}", number / len(sheets)))
        (folder / sheet.name).write_bytes(sheet.make())
    report(Progress("done", 1.0))
    return {"name": plan.name, "carriers": _carriers(plan), **proposed}


_KINDS = {
    CharucoPlate: "ChArUco plate",
    MarkerCarrier: "square markers",
    RingCarrier: "ring-coded targets",
}


def _carriers(plan: TargetPlan) -> list[JSON]:
    return [{"name": c.name, "kind": _KINDS[type(c)], "targets": len(c.ids)} for c in plan.carriers]
