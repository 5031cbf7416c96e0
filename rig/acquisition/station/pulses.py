"""What a station asks of its box: one pulse per output."""

from __future__ import annotations

from common.errors import InputError
from rig.acquisition.station.spec import CameraPlan, Station
from rig.acquisition.trigger.box import ArmRequest, Pulse

LARGEST_SHOTS = 10_000


def station_pulses(station: Station, cameras: tuple[CameraPlan, ...]) -> dict[int, Pulse]:
    """The pulses that fire ``cameras``, the strobes and the LEDs, by output.

    Cameras that are not among ``cameras`` get no pulse: one that is not ready must not make a
    stray exposure that turns up in the next capture. Where it shares its output with one that is
    ready it is fired all the same; what it makes is dropped when it is armed next.
    """
    pulses: dict[int, Pulse] = {}
    for camera in cameras:
        if camera.output is None:
            continue
        shutter = station.shutter_delay_us(camera)
        pulses[camera.output] = Pulse(shutter, camera.width_us)
        if camera.focus_output is not None:
            lead = camera.focus_lead_us
            pulses[camera.focus_output] = Pulse(shutter - lead, lead + camera.width_us)
    for light in (*station.strobes, *station.leds):
        pulses[light.output] = Pulse(station.zero_us + light.delay_us, light.width_us)
    return pulses


def arm_request(
    station: Station,
    cameras: tuple[CameraPlan, ...],
    box_capture: str,
    shots: int = 1,
    interval_us: float = 0.0,
) -> ArmRequest:
    """The whole request for one capture. :class:`InputError` for a burst that cannot be."""
    check_burst(station, shots, interval_us)
    return ArmRequest(
        capture_id=box_capture,
        pulses=station_pulses(station, cameras),
        shots=shots,
        interval_us=interval_us if shots > 1 else 0.0,
        lead_us=station.trigger.lead_us if station.trigger is not None else 0.0,
    )


def check_burst(station: Station, shots: int, interval_us: float) -> None:
    """Raise for shots and an interval that make no burst, or one that nobody could take apart."""
    if not 1 <= shots <= LARGEST_SHOTS:
        raise InputError(
            "shots", f"{shots} shots make no capture", f"give 1 to {LARGEST_SHOTS} shots"
        )
    if shots == 1:
        return
    if not interval_us > 0.0:
        raise InputError("interval", "a burst needs an interval", "give the time from shot to shot")
    for camera in station.cameras:
        latest = camera.expected_lag_us + camera.lag_tolerance_us
        earliest = max(0.0, camera.expected_lag_us - camera.lag_tolerance_us)
        if latest - earliest >= interval_us:
            raise InputError(
                "interval",
                f"shots {interval_us / 1e3:g} ms apart cannot be told from each other by camera "
                f"{camera.name}, whose lag is known to +- {camera.lag_tolerance_us / 1e3:g} ms",
                "give a longer interval, or a smaller lag_tolerance_us where it is true",
            )
