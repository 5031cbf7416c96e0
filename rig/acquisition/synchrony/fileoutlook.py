"""Which files end the wait for a camera's pictures: those that will not be held back."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from rig.acquisition.cameras.base import Frame
from rig.acquisition.synchrony.fileclocks import FiredShot, clock_offset, is_plain
from rig.acquisition.synchrony.fileexposures import FileExposure, Span, file_exposures


@dataclass(frozen=True, eq=False)
class FileOutlook:
    """What is known of a camera's files just before it is fired.

    ``offset``: what its clock is ahead of the computer's; ``outstanding``: how many earlier
    pictures have not come; ``seen``: contents of earlier captures.
    """

    offset: Span | None
    outstanding: int
    seen: Collection[str]
    wait_ns: int = 0

    def likely(self, frames: Sequence[Frame], shots_ns: Sequence[int]) -> list[Frame]:
        """Those of ``frames`` that may be of shots at ``shots_ns``, in ns since 1970."""
        fresh = [f for f in frames if f.metadata.get("sha256", "") not in self.seen]
        shots = [FiredShot("", k + 1, at_ns) for k, at_ns in enumerate(shots_ns)]
        exposures, _ = file_exposures(fresh, len(shots))
        return [f for e in exposures if self._is_likely(e, shots) for f in e.frames]

    def _is_likely(self, exposure: FileExposure, shots: Sequence[FiredShot]) -> bool:
        if exposure.time is None:
            return self.offset is None and not self.outstanding
        offsets = [clock_offset(exposure.time, shot, self.wait_ns) for shot in shots]
        if self.offset is not None:
            return any(offset.common(self.offset) for offset in offsets)
        return not self.outstanding and any(map(is_plain, offsets))
