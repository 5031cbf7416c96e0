"""What cameras' own times say of one another: all of a rig are fired at once.

From one capture to another the clocks of all cameras go on by the same, whoever fires and
however far off each clock is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rig.acquisition.synchrony.fileclocks import FileDelivery
from rig.acquisition.synchrony.fileexposures import SECOND_NS, Span, file_time

SLACK_NS = SECOND_NS // 4
"""How much more apart two cameras may be in one capture than in another: by lags and drift."""
REMEMBERED = 50
"""Captures of each camera."""


class SharedTimes:
    """The times of believed pictures, by camera and capture of one shot."""

    def __init__(self) -> None:
        self._times: dict[str, dict[str, Span]] = {}
        self._now: dict[str, Span] = {}

    def begin(self, deliveries: Sequence[FileDelivery]) -> None:
        """A capture is sorted: what its pictures say, one for each camera, believed or not."""
        self._now = {}
        for one in deliveries:
            times = [file_time(f.metadata) for f in one.frames if not f.metadata.get("known_as")]
            told = {at for at in times if at is not None}
            if len(told) == 1 and len(one.shots) == 1:
                self._now[one.camera] = told.pop()

    def learn(self, camera: str, capture_id: str, at: Span) -> None:
        """The picture of a camera in a capture told this time."""
        times = self._times.setdefault(camera, {})
        times[capture_id] = at
        while len(times) > REMEMBERED:
            del times[next(iter(times))]

    def has(self, camera: str, capture_id: str) -> bool:
        """Whether the camera's picture of this capture is known."""
        return capture_id in self._times.get(camera, {})

    def tell(
        self,
        camera: str,
        at: Span,
        rivals: Sequence[str] = (),
        supposed: Mapping[str, Span] | None = None,
    ) -> bool | None:
        """Whether other cameras show a picture to be of the capture that is sorted.

        ``at``: its time. ``rivals``: captures that it may be of as well. ``supposed``: when its
        camera took pictures of others, where none is believed yet. None: the others say nothing.
        """
        if supposed is not None:
            return self._agree(camera, at, self._now, supposed)
        told = self._agree(camera, at, self._now)
        if not told:
            return told
        earlier = [{c: t[r] for c, t in self._times.items() if r in t} for r in rivals]
        return not any(self._agree(camera, at, times) for times in earlier)

    def _agree(
        self,
        camera: str,
        at: Span,
        theirs: Mapping[str, Span],
        supposed: Mapping[str, Span] | None = None,
    ) -> bool | None:
        """Whether more of the others, at ``theirs``, were taken with it than not; None: as many."""
        mine, said = supposed or self._times.get(camera, {}), list[bool]()
        for other, then in theirs.items():
            shared = [c for c, t in self._times.get(other, {}).items() if c in mine and t != then]
            if other != camera and shared:
                ours = _apart(mine[shared[-1]], at).wider(SLACK_NS, SLACK_NS)
                said.append(bool(ours.common(_apart(self._times[other][shared[-1]], then))))
        against = len(said) - sum(said)
        return None if sum(said) == against else sum(said) > against


def _apart(one: Span, other: Span) -> Span:
    """From one time to another, at least and at most."""
    return Span(other.low_ns - one.high_ns, other.high_ns - one.low_ns)
