"""A camera behind a GenTL producer, through Harvesters."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from genicam import genapi, gentl
from harvesters.core import Harvester

from common.errors import DeviceError
from rig.acquisition.cameras.workers import features
from rig.acquisition.cameras.workers.serve import POLL_S, Picture

GVSP_IDS = 65535
KEPT_BUFFERS = 16
PREVIEW_BUFFERS = 3
USABLE = (genapi.EAccessMode.RO, genapi.EAccessMode.RW, genapi.EAccessMode.WO)


def _told(source: Any, name: str) -> Any:  # noqa: ANN401  the library has no types
    """An attribute that producers may leave out, None then."""
    try:
        return getattr(source, name)
    except (gentl.GenericException, AttributeError):
        return None


def _info(device: Any) -> dict[str, str]:  # noqa: ANN401
    return {
        "id": str(_told(device, "serial_number") or device.id_),
        "model": str(_told(device, "model") or ""),
        "vendor": str(_told(device, "vendor") or ""),
        "address": str(device.id_),
        "transport": str(_told(device, "tl_type") or ""),
    }


@contextlib.contextmanager
def _library() -> Iterator[None]:
    try:
        yield
    except (gentl.InvalidHandleException, gentl.IoException, gentl.ClosedException) as error:
        raise DeviceError("camera-gone", f"its producer says: {error}", "check its cable") from None
    except (gentl.GenericException, genapi.GenericException) as error:
        raise DeviceError(
            "camera-error", f"the camera refused: {error}", "check its settings, or open it again"
        ) from None


class GenapiNodes:
    """Features through the GenApi of the EMVA."""

    def __init__(self, node_map: Any) -> None:  # noqa: ANN401
        self._map = node_map

    def has(self, name: str) -> bool:
        """Whether it is there and can be used now."""
        if not self._map.has_node(name):
            return False
        return self._map.get_node(name).get_access_mode() in USABLE

    def get(self, name: str) -> features.Value:
        """Its value."""
        value: features.Value = self._map.get_node(name).value
        return value

    def set(self, name: str, value: features.Value) -> None:
        """Set it."""
        node = self._map.get_node(name)
        kind = node.node.principal_interface_type
        if kind == genapi.EInterfaceType.intfIInteger:
            node.value = round(float(value))
        elif kind == genapi.EInterfaceType.intfIBoolean:
            node.value = bool(value)
        elif kind == genapi.EInterfaceType.intfIEnumeration and not isinstance(value, str):
            node.value = "On" if value else "Off"
        else:
            node.value = value

    def run(self, name: str) -> None:
        """Execute a command."""
        self._map.get_node(name).execute()

    def bounds(self, name: str) -> tuple[float, float] | None:
        """Least and greatest value of a number."""
        node = self._map.get_node(name)
        return float(node.min), float(node.max)

    def choices(self, name: str) -> Sequence[str]:
        """Values of an enumeration."""
        return [str(symbol) for symbol in self._map.get_node(name).symbolics]


def _require_loadable(producer: str) -> None:
    """Raise an error that names a producer which cannot be loaded: Harvesters passes over it."""
    try:
        loaded = gentl.GenTLProducer.create_producer()
        loaded.open(producer)
        loaded.close()
    except gentl.GenericException as error:
        why = str(error).partition(";")[2].partition(" (ID")[0].strip() or str(error)
        raise DeviceError(
            "producer-broken",
            f"the producer {producer} cannot be loaded ({why})",
            "install the maker's software again, or correct the option 'producers'",
        ) from None


class GenicamDriver:
    """One camera; :class:`.serve.Driver` says what each method does."""

    shares_library = True

    def __init__(self, options: Mapping[str, Any]) -> None:
        self._options = options
        self._harvester: Any = Harvester()
        self._acquirer: Any = None
        self._nodes: Any = None
        self._trigger = "none"
        self._ptp = False
        self._exposure_us: float | None = None

    def _update(self) -> Sequence[Any]:
        with _library():
            for producer in self._options["producers"]:
                self._harvester.add_file(producer)
            self._harvester.update()
        found = list(self._harvester.device_info_list)
        if not found:
            for producer in self._options["producers"]:
                _require_loadable(producer)
        return found

    def discover(self, skip: Sequence[str]) -> list[dict[str, str]]:  # noqa: ARG002
        """Cameras of all producers, also those in use."""
        infos = [_info(device) for device in self._update()]
        return [{k: v for k, v in one.items() if k != "transport"} for one in infos]

    def open(self, camera_id: str) -> Mapping[str, Any]:
        """Take control of the camera with this serial number."""
        devices = self._update()
        places = [n for n, device in enumerate(devices) if _info(device)["id"] == camera_id]
        if not places:
            raise DeviceError(
                "camera-gone", f"no producer finds a camera {camera_id}", "check power and cable"
            )
        info = _info(devices[places[0]])
        with _library():
            self._acquirer = self._harvester.create(places[0])
            self._nodes = GenapiNodes(self._acquirer.remote_device.node_map)
            self._set_up()
        return {"info": info, "capabilities": self._capabilities(info["transport"])}

    def _set_up(self) -> None:
        options = self._options
        self._trigger = features.set_trigger(
            self._nodes, options["trigger"], options["trigger_line"]
        )
        if self._trigger == "none":
            features.set_rate(self._nodes, options["frame_rate_hz"])
        if options["ptp"]:
            features.enable_ptp(self._nodes)
            self._ptp = features.await_ptp(self._nodes, options["ptp_wait_s"])

    def _capabilities(self, transport: str) -> Mapping[str, Any]:
        short = transport.startswith(("GEV", "GigE"))
        clock = any(self._nodes.has(command) for command, _, _ in features.LATCHES)
        return {
            "trigger": self._trigger,
            "timestamps": "ptp" if self._ptp else "device" if clock else "none",
            "frame_counter": True,
            "frame_counter_modulus": GVSP_IDS if short else None,
            "frame_counter_skips_zero": short,
            "exposure_start_delay_us": features.exposure_delay_us(self._nodes),
            "settable": features.settable(self._nodes),
            "previews": True,
        }

    def configure(self, settings: Mapping[str, Any]) -> Mapping[str, Any]:
        """Set what is not None; all settings as they are now."""
        with _library():
            self._acquirer.stop()
            return features.configure(self._nodes, settings)

    def arm(self, shots: int) -> int:
        """Start streaming with an empty queue; frames of before are counted and dropped."""
        with _library():
            dropped = self._stop()
            self._exposure_us = features.read_settings(self._nodes)["exposure_us"]
            wanted = max(min(shots + 4, KEPT_BUFFERS), self._acquirer.min_num_buffers)
            self._acquirer.num_buffers = wanted
            self._acquirer.start()
        return dropped

    def _stop(self) -> int:
        if not self._acquirer.is_acquiring():
            return 0
        dropped = 0
        while (buffer := self._acquirer.try_fetch(timeout=0.001)) is not None:
            buffer.queue()
            dropped += 1
            if dropped >= KEPT_BUFFERS:
                break
        self._acquirer.stop()
        return dropped

    def trigger(self) -> None:
        """Expose now."""
        with _library():
            self._nodes.run("TriggerSoftware")

    def collect(self) -> None:
        """Frames are fetched all the time."""

    def poll(self, timeout_s: float) -> Sequence[Picture]:
        """The next frame, waiting at most so long."""
        with _library():
            buffer = self._acquirer.try_fetch(timeout=timeout_s)
            if buffer is None:
                return ()
            arrived_ns = time.monotonic_ns()
            try:
                return (self._picture(buffer, arrived_ns),)
            finally:
                buffer.queue()

    def _picture(self, buffer: Any, arrived_ns: int) -> Picture:  # noqa: ANN401
        header: dict[str, Any] = {
            "arrived_host_ns": arrived_ns,
            "status": "ok" if buffer.is_complete() else "incomplete",
            "counter": int(buffer.module.frame_id),
            "device_ns": _timestamp_ns(buffer),
            "exposure_us": self._exposure_us,
        }
        if not buffer.is_complete():
            header["metadata"] = {"problem": "part of it did not arrive: look at cable and network"}
        components = buffer.payload.components
        if not components or components[0].data is None:
            return header, b""
        part = components[0]
        header.update(
            pixel_format=str(part.data_format), width=int(part.width), height=int(part.height)
        )
        return header, part.data.tobytes()

    def preview(self, over: Callable[[], bool]) -> Picture | None:
        """The first frame of a camera that runs freely for a moment."""
        with _library():
            self._stop()
            with features.untriggered(self._nodes):
                self._acquirer.num_buffers = max(PREVIEW_BUFFERS, self._acquirer.min_num_buffers)
                self._acquirer.start()
                try:
                    return self._first(over)
                finally:
                    self._stop()

    def _first(self, over: Callable[[], bool]) -> Picture | None:
        while not over():
            pictures = self.poll(POLL_S)
            if pictures and pictures[0][1]:
                return pictures[0]
        return None

    def rest(self) -> None:
        """It stands still already."""

    def disarm(self) -> None:
        """Take no more triggers."""
        with _library():
            self._stop()

    def clock(self, count: int) -> Sequence[Sequence[int]]:
        """Latched readings of the camera's clock."""
        with _library():
            readings = [features.latch(self._nodes) for _ in range(count)]
        return [reading for reading in readings if reading is not None]

    def ping(self) -> Mapping[str, int]:
        """Read a feature that every camera has; the stream's counters."""
        with _library():
            self._nodes.get("PayloadSize" if self._nodes.has("PayloadSize") else "Width")
        names = {"num_delivered": "delivered", "num_underrun": "underruns"}
        streams = self._acquirer.data_streams
        counts = (
            {}
            if not streams
            else {
                ours: _told(
                    streams[0].module if hasattr(streams[0], "module") else streams[0], theirs
                )
                for theirs, ours in names.items()
            }
        )
        return {name: int(count) for name, count in counts.items() if count is not None}

    def close(self) -> None:
        """Give control back and unload the producers."""
        with contextlib.suppress(gentl.GenericException, genapi.GenericException):
            if self._acquirer is not None:
                self._acquirer.destroy()
            self._harvester.reset()
        self._acquirer = self._nodes = None


def _timestamp_ns(buffer: Any) -> int | None:  # noqa: ANN401
    """The camera's stamp; producers may give it in ns, in ticks, or not at all."""
    stamp = _told(buffer, "timestamp_ns")
    if stamp:
        return int(stamp)
    ticks, rate = _told(buffer, "timestamp"), _told(buffer, "timestamp_frequency")
    return int(ticks) * 10**9 // int(rate) if ticks and rate else None
