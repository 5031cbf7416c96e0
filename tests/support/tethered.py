"""Rigs of folder cameras, and files that arrive in their folders while a capture runs."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from datetime import datetime
from io import BytesIO
from pathlib import Path

import numpy as np
from memoryrig import with_policy
from PIL import Image
from PIL.ExifTags import IFD, Base

from rig.acquisition.capture.rig import Rig
from rig.acquisition.session.folder import Session
from rig.acquisition.session.records import CaptureRecord
from rig.acquisition.station.spec import CameraPlan, Station

CAMERAS = ("cam01", "cam02", "cam03")


def jpeg(at: datetime | None, seed: int, serial: str = "", scale: int = 1) -> bytes:
    """A picture taken at ``at`` by its camera's clock; the seed is what it shows."""
    size = (24 * scale, 32 * scale, 3)
    noise = np.random.default_rng(seed).integers(60, 250, size, np.uint8)
    exif = Image.Exif()
    details = exif.get_ifd(IFD.Exif)
    if at is not None:
        details[Base.DateTimeOriginal] = at.strftime("%Y:%m:%d %H:%M:%S")
        details[Base.SubsecTimeOriginal] = f"{at.microsecond:06d}"[:2]
    if serial:
        details[Base.BodySerialNumber] = serial
    data = BytesIO()
    Image.fromarray(noise).save(data, "JPEG", exif=exif)
    return data.getvalue()


def station(root: Path, **more: object) -> Station:
    for name in CAMERAS:
        (root / name).mkdir(parents=True, exist_ok=True)
    plans = tuple(CameraPlan(name, "folder", name, **more) for name in CAMERAS)
    options = {"folder": {"root": str(root), "settle_s": 0.05}}
    made = Station("tethered", plans, backend_options=options)
    return with_policy(made, frame_deadline_s=1.0, settle_s=0.15, min_free_mb=0.0)


class Tethered:
    """An open rig of folder cameras and a session."""

    def __init__(self, rig: Rig, session: Session, root: Path) -> None:
        self.rig, self.session, self.root = rig, session, root
        self.seed = 0

    def write(self, camera: str, name: str, at: datetime | None) -> bytes:
        self.seed += 1
        data = jpeg(at, self.seed)
        (self.root / camera / name).write_bytes(data)
        return data

    def capture(
        self, capture_id: str, deliver: Callable[[datetime], None], delay_s: float = 0.1
    ) -> CaptureRecord:
        """A capture during which files arrive; they are told when FIRE was."""

        def soon() -> None:
            fired = datetime.now()
            time.sleep(delay_s)
            deliver(fired)

        def on(progress: object) -> None:
            if getattr(progress, "stage", "") == "firing":
                threading.Thread(target=soon).start()

        return self.rig.capture(self.session, capture_id, progress=on).record

    def sound(self, number: int) -> Callable[[datetime], None]:
        """Every camera delivers its picture."""

        def deliver(fired: datetime) -> None:
            for name in CAMERAS:
                self.write(name, f"DSC_{number:04d}.JPG", fired)

        return deliver


def held(record: CaptureRecord) -> str:
    return "; ".join(fault.text for fault in record.faults if fault.kind == "held-back")
