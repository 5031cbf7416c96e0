"""Target sets: checked, written as target files, and read again to be printed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from calibration.targets.files import read_targets, targets_from, targets_of, targets_text
from calibration.targets.kinds import TargetPlan
from service.kinds.defaults import PAGE
from service.kinds.targets import SeenByCamera, TargetsModel
from service.tasks.proposing import proposal_for, seen_by_cameras
from service.tasks.sheets import Sheet, sheets_of


@dataclass(frozen=True)
class TargetFile:
    """A target set as the ``text`` of a target file (TOML); ``carriers``: targets on each."""

    name: str
    carriers: Mapping[str, int]
    text: str


@dataclass(frozen=True)
class ProposedFile:
    """Targets for a rig, what its cameras see of them, and what is to be known of them."""

    targets: TargetFile
    cameras: tuple[SeenByCamera, ...]
    notes: tuple[str, ...]


def given_targets(given: TargetsModel) -> TargetFile:
    """Targets that somebody describes. Raises :class:`~common.errors.InputError`."""
    return _file_of(targets_of(given))


def read_target_text(text: str, name: str) -> TargetFile:
    """Targets of a target file called ``name``. Raises a one-line :class:`InputError`."""
    return _file_of(targets_from(text, name))


def proposed_targets(design: Path) -> ProposedFile:
    """Targets for the rig of a design file. Raises :class:`~common.errors.InputError`."""
    proposal = proposal_for(design)
    cameras = tuple(seen_by_cameras(proposal))
    return ProposedFile(_file_of(proposal.plan), cameras, tuple(proposal.notes))


def sheets_of_file(targets: Path, page: str = PAGE) -> Mapping[str, Sheet]:
    """What can be printed of a target file, by file name; see :func:`sheets_of`."""
    return sheets_of(read_targets(targets), page)


def _file_of(plan: TargetPlan) -> TargetFile:
    carriers = {carrier.name: len(carrier.ids) for carrier in plan.carriers}
    return TargetFile(plan.name, carriers, targets_text(plan))
