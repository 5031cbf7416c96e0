"""What a capture that was interrupted had been about to fire."""

from __future__ import annotations

from datetime import datetime

from pydantic import Field

from common.errors import InputError
from common.files.reading import plain_bytes
from common.files.strict import StrictModel
from rig.acquisition.session import paths
from rig.acquisition.session.index import SessionIndex
from rig.acquisition.session.jsonfiles import read_model
from rig.acquisition.session.records import InterruptedEntry


class Intent(StrictModel):
    """``intent.json`` in the folder of a capture whose box was about to be armed."""

    capture_id: str = Field(description="The id the client chose.")
    box_capture: str = Field(description="Its name at the box.")
    shots: int = Field(default=1, ge=1, description="How many shots were asked for.")
    interval_us: float = Field(default=0.0, ge=0.0, description="Between two of them.")
    at: str = Field(default="", description="When that was, ISO 8601 with offset.")

    @property
    def at_ns(self) -> int:
        """The same in ns since 1970; ValueError where it is no time."""
        return round(datetime.fromisoformat(self.at).timestamp() * 1e9)


def interrupted_intents(index: SessionIndex) -> tuple[Intent, ...]:
    """What the interrupted captures of a session had been about to fire, in the order listed."""
    return tuple(_intent(index, aside) for aside in index.manifest.interrupted)


def _intent(index: SessionIndex, aside: InterruptedEntry) -> Intent:
    try:
        data = plain_bytes(index.folder / aside.folder / paths.INTENT)
        intent = read_model(Intent, data, paths.INTENT)
        # Written before times were, or by another hand: when it was found out is near enough.
        return intent if intent.at else intent.model_copy(update={"at": aside.at})
    except (OSError, InputError):
        return Intent(capture_id=aside.capture_id, box_capture="", at=aside.at)
