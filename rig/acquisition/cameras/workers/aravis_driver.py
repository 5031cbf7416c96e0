"""A GigE Vision or USB3 Vision camera through Aravis. Runs under the Python that has PyGObject."""

from __future__ import annotations

import contextlib
import ipaddress
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Optional

import gi

from rig.acquisition.cameras.workers import features
from rig.acquisition.cameras.workers.aravis_nodes import AravisNodes, gone, library, pfnc
from rig.acquisition.cameras.workers.serve import POLL_S, Picture

gi.require_version("Aravis", "0.8")
from gi.repository import Aravis, GLib  # noqa: E402

GVSP_IDS = 65535
"""Frame ids of GigE Vision are 1 to 65535; 0 is none."""
CONTROL_REGISTER, CONTROL_BITS = 0x0A00, 0x3
"""Who controls a GigE Vision camera: exclusive access and control access."""
KEPT_BUFFERS = 16
PREVIEW_BUFFERS = 3
LOSSES = {
    Aravis.BufferStatus.MISSING_PACKETS: "packets of it did not arrive: look at the network, its "
    "cables, packet size and packet delay",
    Aravis.BufferStatus.TIMEOUT: "it stopped coming half-way: look at the cable and the network",
    Aravis.BufferStatus.SIZE_MISMATCH: "it was larger than the camera had said",
}
"""What is said of a frame that its transport did not bring as a whole."""
COUNTERS = (
    "n_completed_buffers",
    "n_failures",
    "n_underruns",
    "n_missing_frames",
    "n_missing_packets",
    "n_resent_packets",
)


def _found() -> list[dict[str, str]]:
    # Without this a camera opens and its registers answer, but its stream stays silent.
    Aravis.update_device_list()
    return [
        {
            "key": Aravis.get_device_id(index),
            "id": Aravis.get_device_serial_nbr(index) or Aravis.get_device_id(index),
            "model": Aravis.get_device_model(index) or "",
            "vendor": Aravis.get_device_vendor(index) or "",
            "address": Aravis.get_device_address(index) or "",
            "protocol": Aravis.get_device_protocol(index) or "",
        }
        for index in range(Aravis.get_n_devices())
    ]


def _at(address: str, camera_id: str) -> tuple[Any, dict[str, str]] | None:
    """The camera at a network address, if it is the one with this serial number."""
    try:
        ipaddress.ip_address(address)
        camera = Aravis.Camera.new(address)
        if camera.get_device_serial_number() != camera_id:
            return None
        info = {
            "id": camera_id,
            "model": camera.get_model_name(),
            "vendor": camera.get_vendor_name(),
            "address": address,
            "protocol": "GigEVision",
        }
    except (ValueError, GLib.Error):
        return None
    return camera, info


class AravisDriver:
    """One camera; :class:`.serve.Driver` says what each method does."""

    shares_library = True

    def __init__(self, options: Mapping[str, Any]) -> None:
        self._options = options
        self._camera: Any = None
        self._stream: Any = None
        self._nodes: Any = None
        self._running = False
        self._lost = ""
        self._trigger = "none"
        self._ptp = False
        self._exposure_us: Optional[float] = None  # noqa: UP045
        self._fired: list[int] = []
        self._brackets: list[tuple[int, int, int]] = []

    def discover(self, skip: Sequence[str]) -> list[dict[str, str]]:  # noqa: ARG002
        """Cameras on the networks and buses of this machine, also those in use."""
        return [{key: value for key, value in one.items() if key != "key"} for one in _found()]

    def open(self, camera_id: str) -> Mapping[str, Any]:
        """Take control of the camera with this serial number."""
        with library():
            self._camera, info = self._reach(camera_id)
            self._nodes = AravisNodes(self._camera)
            self._camera.get_device().connect("control-lost", self._on_lost)
            # A free-running or half set up camera must stand still until it is armed.
            self._camera.stop_acquisition()
            self._set_up()
        return {"info": info, "capabilities": self._capabilities(info["protocol"])}

    def _reach(self, camera_id: str) -> tuple[Any, dict[str, str]]:
        # Discovery takes a second: a known address saves it, and reaches through routers.
        near = _at(self._options["address"], camera_id) if self._options["address"] else None
        if near is not None:
            return near
        found = [one for one in _found() if one["id"] == camera_id]
        if not found:
            raise gone(f"none on the network or USB has the serial number {camera_id}")
        return Aravis.Camera.new(found[0]["key"]), found[0]

    def _set_up(self) -> None:
        options = self._options
        if self._camera.is_gv_device():
            if options["packet_size"] is not None:
                self._camera.gv_set_packet_size(options["packet_size"])
            if options["packet_delay_ns"] is not None:
                self._camera.gv_set_packet_delay(options["packet_delay_ns"])
        self._trigger = features.set_trigger(
            self._nodes, options["trigger"], options["trigger_line"]
        )
        if self._trigger == "none":
            features.set_rate(self._nodes, options["frame_rate_hz"])
        if options["ptp"]:
            features.enable_ptp(self._nodes)
            self._ptp = features.await_ptp(self._nodes, options["ptp_wait_s"])
        self._camera.set_acquisition_mode(Aravis.AcquisitionMode.CONTINUOUS)

    def _capabilities(self, protocol: str) -> Mapping[str, Any]:
        extended = self._nodes.has("GevGVSPExtendedIDMode") and (
            self._nodes.get("GevGVSPExtendedIDMode") == "On"
        )
        short = protocol == "GigEVision" and not extended
        return {
            "trigger": self._trigger,
            "timestamps": "ptp" if self._ptp else "device",
            "frame_counter": True,
            "frame_counter_modulus": GVSP_IDS if short else None,
            "frame_counter_skips_zero": short,
            "exposure_start_delay_us": features.exposure_delay_us(self._nodes),
            "settable": features.settable(self._nodes),
            "previews": True,
        }

    def _on_lost(self, *_: object) -> None:
        self._lost = "the library lost control of it"

    def configure(self, settings: Mapping[str, Any]) -> Mapping[str, Any]:
        """Set what is not None; all settings as they are now."""
        with library():
            self._stop()
            return features.configure(self._nodes, settings)

    def arm(self, shots: int) -> int:
        """Start streaming with an empty queue; frames of before are counted and dropped."""
        self._check_control()
        with library():
            dropped = self._stop()
            self._begin(min(shots + 4, KEPT_BUFFERS))
        self._fired.clear()
        return dropped

    def _begin(self, buffers: int) -> None:
        self._stream = self._camera.create_stream(None, None)
        if self._stream is None:
            raise gone("its stream cannot be opened")
        self._exposure_us = features.read_settings(self._nodes)["exposure_us"]
        payload = self._camera.get_payload()
        for _ in range(buffers):
            self._stream.push_buffer(Aravis.Buffer.new_allocate(payload))
        self._camera.start_acquisition()
        self._running = True

    def _check_control(self) -> None:
        """A camera that was without power answers again, but has forgotten us and its settings."""
        if self._lost:
            raise gone(self._lost)
        with library():
            network = self._camera.is_gv_device()
            value = self._camera.get_device().read_register(CONTROL_REGISTER if network else 0)
        if network and not value & CONTROL_BITS:
            self._lost = "it was started anew"
            raise gone(self._lost)

    def _stop(self) -> int:
        """Stop streaming; returns how many frames had come and were not fetched."""
        if not self._running:
            return 0
        self._running = False
        self._camera.stop_acquisition()
        dropped = 0
        while (buffer := self._stream.try_pop_buffer()) is not None:
            dropped += buffer.get_status() != Aravis.BufferStatus.ABORTED
        self._stream = None
        return dropped

    def trigger(self) -> None:
        """Expose now."""
        self._fired.append(time.monotonic_ns())
        with library():
            self._camera.software_trigger()

    def collect(self) -> None:
        """Frames are fetched all the time."""

    def poll(self, timeout_s: float) -> Sequence[Picture]:
        """Frames that have come, waiting at most so long for the first."""
        if self._lost:
            raise gone(self._lost)
        pictures = []
        buffer = self._stream.timeout_pop_buffer(int(timeout_s * 1e6))
        while buffer is not None:
            pictures.append(self._picture(buffer, time.monotonic_ns()))
            self._stream.push_buffer(buffer)
            buffer = self._stream.try_pop_buffer()
        return pictures

    def _picture(self, buffer: Any, arrived_ns: int) -> Picture:  # noqa: ANN401
        whole = buffer.get_status() == Aravis.BufferStatus.SUCCESS
        device_ns = int(buffer.get_timestamp())
        # The oldest command not yet answered is never after the one that made this frame, even
        # if the camera left one out; so the camera's stamp lies within the bracket in any case.
        if self._fired and device_ns:
            bracket = (self._fired.pop(0), device_ns, arrived_ns)
            self._brackets = [*self._brackets[-63:], bracket]
        notes = {"transport": buffer.get_status().value_nick}
        if not whole:
            notes["problem"] = LOSSES.get(buffer.get_status(), "it did not come whole")
        header: dict[str, Any] = {
            "arrived_host_ns": arrived_ns,
            "status": "ok" if whole else "incomplete",
            "counter": int(buffer.get_frame_id()),
            "device_ns": device_ns or None,
            "exposure_us": self._exposure_us,
            "metadata": notes,
        }
        if not whole and not buffer.get_data():
            return header, b""
        try:
            header["width"] = int(buffer.get_image_width())
            header["height"] = int(buffer.get_image_height())
            header["pixel_format"] = pfnc(buffer.get_image_pixel_format())
            return header, bytes(buffer.get_image_data())
        except (GLib.Error, TypeError, ValueError):
            # The library keeps nothing of some frames that are not whole, not even their size.
            return header, b""

    def preview(self, over: Callable[[], bool]) -> Optional[Picture]:  # noqa: UP045
        """The first frame of a camera that runs freely for a moment."""
        self._check_control()
        with library():
            self._stop()
            with features.untriggered(self._nodes):
                self._begin(PREVIEW_BUFFERS)
                try:
                    while not over():
                        pictures = self.poll(POLL_S)
                        if pictures and pictures[0][1]:
                            return pictures[0]
                finally:
                    self._stop()
        return None

    def rest(self) -> None:
        """It stands still already."""

    def disarm(self) -> None:
        """Take no more triggers."""
        with library():
            self._stop()

    def clock(self, count: int) -> Sequence[Sequence[int]]:
        """Latched readings; without a latch, frames made by command bracket the clock."""
        with library():
            readings = [features.latch(self._nodes) for _ in range(count)]
        found = [reading for reading in readings if reading is not None]
        return found or self._brackets[-count:]

    def ping(self) -> Mapping[str, int]:
        """Whether we still control it; the stream's counters."""
        self._check_control()
        stream = self._stream
        if stream is None:
            return {}
        return {name[2:]: int(stream.get_info_uint64_by_name(name)) for name in COUNTERS}

    def close(self) -> None:
        """Give control back."""
        with contextlib.suppress(GLib.Error):
            self._stop()
        self._stream = self._nodes = self._camera = None
