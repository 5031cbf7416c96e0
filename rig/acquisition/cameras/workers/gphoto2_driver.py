"""One body over USB through libgphoto2."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import PurePosixPath
from typing import Any

import gphoto2 as gp

from common.errors import DeviceError, InputError
from rig.acquisition.cameras.workers.bodysettings import WIDGETS, nearest, read_value
from rig.acquisition.cameras.workers.serve import Picture

STORE_FULL_EVENT = "event 400a"
"""The PTP event of a full card, as libgphoto2 spells it."""
FULL = {gp.GP_ERROR_NO_MEMORY, gp.GP_ERROR_NO_SPACE}
BUSY = {gp.GP_ERROR_CAMERA_BUSY, gp.GP_ERROR_IO_USB_CLAIM, gp.GP_ERROR_IO_LOCK}
SILENT = {
    gp.GP_ERROR_IO,
    gp.GP_ERROR_IO_READ,
    gp.GP_ERROR_IO_WRITE,
    gp.GP_ERROR_TIMEOUT,
    gp.GP_ERROR_IO_USB_FIND,
    gp.GP_ERROR_MODEL_NOT_FOUND,
    gp.GP_ERROR_UNKNOWN_PORT,
}
DRAIN_S = 2.0
QUIET_MS = 50
FIND_S = 6.0
TARGETS = {"memory": "Internal RAM", "card": "Memory card"}


def _card_full() -> DeviceError:
    return DeviceError(
        "camera-card-full",
        "the memory card is full",
        "empty it or put in another, or set the option 'target' to 'memory'",
    )


def _translate(error: Exception) -> DeviceError:
    code = error.code  # type: ignore[attr-defined]
    if code in FULL:
        return _card_full()
    if code in SILENT:
        return DeviceError("camera-gone", f"the body does not answer: {error}", "check its cable")
    return DeviceError("camera-error", f"the body refused: {error}", "look at its display")


@contextlib.contextmanager
def _library() -> Iterator[None]:
    try:
        yield
    except gp.GPhoto2Error as error:
        raise _translate(error) from None


class GphotoDriver:
    """One body; :class:`.serve.Driver` says what each method does."""

    shares_library = False

    def __init__(self, options: Mapping[str, Any]) -> None:
        self._options = options
        self._camera: Any = None
        self._armed = False
        self._collecting_since: float | None = None
        self._full_room: int | None = None
        if options["virtual_folder"]:
            # The library reads both when it is first asked for ports.
            os.environ["IOLIBS"] = os.environ["IOLIBS"].replace("iolibs", "vusb")
            os.environ["VCAMERADIR"] = options["virtual_folder"]

    def discover(self, skip: Sequence[str]) -> list[dict[str, str]]:
        """Bodies on USB that tell a serial number and are not in use."""
        found = []
        for model, port in self._ports():
            if port in skip:
                continue
            with contextlib.suppress(gp.GPhoto2Error):
                camera = self._connect(port)
                serial = _serial(camera)
                camera.exit()
                if serial:
                    found.append({"id": serial, "model": model, "address": port})
        return found

    def _ports(self) -> list[tuple[str, str]]:
        with _library():
            cameras = gp.Camera.autodetect()
        places = range(cameras.count())
        return [(str(cameras.get_name(n)), str(cameras.get_value(n))) for n in places]

    def _connect(self, port: str) -> Any:  # noqa: ANN401  the library has no types
        ports = gp.PortInfoList()
        ports.load()
        camera = gp.Camera()
        # A port that is not given explicitly means "any camera": another body would fire.
        camera.set_port_info(ports[ports.lookup_path(port)])
        camera.init()
        return camera

    def open(self, camera_id: str) -> Mapping[str, Any]:
        """Find the body by its serial number: ports change with every plugging in."""
        deadline = time.monotonic() + FIND_S
        while True:
            info, busy = self._find(camera_id)
            if info is not None:
                break
            if not busy or time.monotonic() > deadline:
                raise DeviceError(
                    "camera-gone",
                    f"no body on USB has the serial number {camera_id}",
                    "check power and cable; a file manager that opened it must let go of it",
                )
            # Another worker is looking at this port on its own search.
            time.sleep(0.2)
        with _library():
            self._choose("capturetarget", TARGETS[self._options["target"]])
        return {"info": info, "capabilities": self._capabilities()}

    def _find(self, camera_id: str) -> tuple[dict[str, str] | None, bool]:
        busy = False
        for model, port in self._ports():
            try:
                camera = self._connect(port)
            except gp.GPhoto2Error as error:
                busy = busy or error.code in BUSY
                continue
            if _serial(camera) == camera_id:
                self._camera = camera
                return {"id": camera_id, "model": model, "address": port}, busy
            camera.exit()
        return None, busy

    def _capabilities(self) -> Mapping[str, Any]:
        return {
            "trigger": self._options["trigger"],
            "timestamps": "none",
            "frame_counter": False,
            "fetched": True,
            "settable": [field for field in WIDGETS if self._widget(field) is not None],
            "previews": bool(
                self._camera.get_abilities().operations & gp.GP_OPERATION_CAPTURE_PREVIEW
            ),
        }

    def _widget(self, field: str) -> Any:  # noqa: ANN401
        for name in WIDGETS[field]:
            with contextlib.suppress(gp.GPhoto2Error):
                widget = self._camera.get_single_config(name)
                if not widget.get_readonly():
                    return widget
        return None

    def _choose(self, name: str, choice: str) -> None:
        with contextlib.suppress(gp.GPhoto2Error):
            widget = self._camera.get_single_config(name)
            widget.set_value(choice)
            self._camera.set_single_config(name, widget)

    def configure(self, settings: Mapping[str, Any]) -> Mapping[str, Any]:
        """Set the nearest value the body has; all settings as they are now."""
        for field in ("gain_db", "pixel_format"):
            if settings.get(field) is not None:
                raise InputError(
                    "camera-setting", f"{field}: a body has no such setting", "leave it out"
                )
        with _library():
            for field in WIDGETS:
                if settings.get(field) is not None:
                    self._set(field, float(settings[field]))
            return {field: self._read(field) for field in WIDGETS}

    def _set(self, field: str, wanted: float) -> None:
        widget = self._widget(field)
        if widget is None:
            raise InputError(
                "camera-setting",
                f"{field}: this body does not let it be set over USB",
                "set it at the body, in manual mode, and leave it out here",
            )
        places = range(widget.count_choices())
        choice = nearest(field, wanted, [widget.get_choice(n) for n in places])
        widget.set_value(choice)
        self._camera.set_single_config(widget.get_name(), widget)

    def _read(self, field: str) -> float | int | None:
        widget = self._widget(field)
        value = read_value(field, widget.get_value()) if widget is not None else None
        return None if value is None else round(value) if field == "iso" else value

    def arm(self, shots: int) -> int:
        """Fetch away what is left of before; afterwards nothing is asked of the body."""
        self._armed, self._collecting_since = False, None
        with _library():
            dropped = self._drain()
            self._check_room(shots)
        self._armed = True
        return dropped

    def _drain(self) -> int:
        dropped = 0
        deadline = time.monotonic() + DRAIN_S
        while time.monotonic() < deadline:
            kind, data = self._camera.wait_for_event(QUIET_MS)
            if kind == gp.GP_EVENT_TIMEOUT:
                break
            if kind == gp.GP_EVENT_FILE_ADDED:
                # Fetched though nobody wants it: it would fill the body's memory otherwise.
                self._camera.file_get(data.folder, data.name, gp.GP_FILE_TYPE_NORMAL)
                dropped += 1
        return dropped

    def _room(self) -> int | None:
        with contextlib.suppress(gp.GPhoto2Error):
            stores = self._camera.get_storageinfo()
            free = [s.freeimages for s in stores if s.fields & gp.GP_STORAGEINFO_FREESPACEIMAGES]
            return int(max(free)) if free else None
        return None

    def _check_room(self, shots: int) -> None:
        room = self._room()
        unchanged = self._full_room is not None and room == self._full_room
        if unchanged or (self._options["target"] == "card" and room is not None and room < shots):
            raise _card_full()
        self._full_room = None

    def trigger(self) -> None:
        """Release the shutter over USB; files are asked for from the next :meth:`collect` on."""
        self._collecting_since = None
        with _library():
            self._camera.trigger_capture()

    def collect(self) -> None:
        """The shutter was released: ask for files from now on."""
        if self._armed and self._collecting_since is None:
            self._collecting_since = time.monotonic()

    def poll(self, timeout_s: float) -> Sequence[Picture]:
        """One step of the body's event loop, once it may be asked."""
        if self._collecting_since is None:
            time.sleep(timeout_s)
            return ()
        try:
            kind, data = self._camera.wait_for_event(int(timeout_s * 1000))
            if kind == gp.GP_EVENT_FILE_ADDED:
                return self._fetch(data.folder, data.name)
        except gp.GPhoto2Error as error:
            held_s = time.monotonic() - self._collecting_since
            if error.code in BUSY | SILENT and held_s < self._options["busy_s"]:
                time.sleep(timeout_s)
                return ()
            raise _translate(error) from None
        if kind == gp.GP_EVENT_UNKNOWN and STORE_FULL_EVENT in str(data).lower():
            self._full_room = self._room() or 0
            raise _card_full()
        return ()

    def _fetch(self, folder: str, name: str) -> Sequence[Picture]:
        file = self._camera.file_get(folder, name, gp.GP_FILE_TYPE_NORMAL)
        wanted = [suffix.lower() for suffix in self._options["suffixes"]]
        if wanted and PurePosixPath(name).suffix.lower() not in wanted:
            return ()
        header = {
            "arrived_host_ns": time.monotonic_ns(),
            "status": "ok",
            "media_type": file.get_mime_type(),
            "metadata": {"file": name},
        }
        return ((header, bytes(file.get_data_and_size())),)

    def preview(self, over: Callable[[], bool]) -> Picture | None:
        """What the body's screen would show."""
        if over():
            return None
        with _library():
            file = self._camera.capture_preview()
            header = {
                "arrived_host_ns": time.monotonic_ns(),
                "status": "ok",
                "media_type": file.get_mime_type(),
            }
            return header, bytes(file.get_data_and_size())

    def rest(self) -> None:
        """Let the mirror down: with it up most bodies take no release at their socket."""
        with contextlib.suppress(gp.GPhoto2Error):
            widget = self._camera.get_single_config("viewfinder")
            if widget.get_value():
                widget.set_value(0)
                self._camera.set_single_config("viewfinder", widget)

    def disarm(self) -> None:
        """Ask for no more files."""
        self._armed, self._collecting_since = False, None

    def clock(self, count: int) -> Sequence[Sequence[int]]:  # noqa: ARG002
        """No body tells its clock finely enough."""
        return ()

    def ping(self) -> Mapping[str, int]:
        """Free room, while it is not armed.

        An armed body must be left alone until the box is done, and then to :meth:`poll`, which
        tells when it is gone.
        """
        if self._full_room is not None:
            raise _card_full()
        if self._armed:
            return {}
        with _library():
            # Answers from the body itself; a name that is not there is an answer too.
            with contextlib.suppress(gp.GPhoto2Error):
                self._camera.get_single_config("batterylevel")
            room = self._room()
        return {} if room is None else {"free_images": room}

    def close(self) -> None:
        """Let go of the body."""
        if self._camera is not None:
            with contextlib.suppress(gp.GPhoto2Error):
                self._camera.exit()
        self._camera = None


def _serial(camera: Any) -> str:  # noqa: ANN401
    with contextlib.suppress(gp.GPhoto2Error):
        value = str(camera.get_single_config("serialnumber").get_value()).strip()
        return "" if set(value) <= {"0"} else value
    return ""
