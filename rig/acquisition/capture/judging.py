"""From what the devices gave to pictures with their shots and all faults named."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from common.errors import DeviceError
from rig.acquisition.cameras.base import (
    CameraCapabilities,
    ClockSample,
    Frame,
    TimestampKind,
    TriggerKind,
)
from rig.acquisition.capture.camerathreads import CameraThread
from rig.acquisition.capture.collect import Collected
from rig.acquisition.capture.firing import Firing, file_wait_ns
from rig.acquisition.station.spec import CameraPlan, Station
from rig.acquisition.synchrony.cameraframes import CameraFrames, Method, Pairing
from rig.acquisition.synchrony.capturedata import CameraPart, CaptureData
from rig.acquisition.synchrony.clocks import ClockFitter, DeviceClock, TriggerTime, clock_jumped
from rig.acquisition.synchrony.faults import Fault, FaultKind
from rig.acquisition.synchrony.fileclocks import FileDelivery, FiredShot
from rig.acquisition.synchrony.fileevidence import FileEvidence
from rig.acquisition.synchrony.imagechecks import image_faults, is_raw
from rig.acquisition.synchrony.pairing import late_faults, pair
from rig.acquisition.synchrony.swaps import swapped
from rig.acquisition.synchrony.triggertimes import command_times, edge_times
from rig.acquisition.trigger.box import FireOutcome

Sizes = Mapping[str, tuple[int, int]]


def pair_and_judge(
    station: Station,
    firing: Firing,
    fit: ClockFitter,
    sizes: Sizes,
    files: FileEvidence | None = None,
) -> CaptureData:
    """Pair and judge everything one firing gave. ``sizes``: what pictures must measure, by camera.

    ``files``: what earlier captures taught of cameras that are only seen through their files.

    Raises :class:`DeviceError` ``trigger-unknown`` when nobody can tell whether the box fired,
    and no picture shows that it did.
    """
    shots = _shots_done(firing)
    parts = tuple(_part(station, firing, thread, fit, sizes, shots) for thread in firing.threads)
    parts = _by_files(station, firing, parts, files or FileEvidence(), sizes)
    _require_fired(firing, parts)
    faults = [
        *firing.faults,
        *_stopped(firing, shots),
        *swapped(station, parts),
        *_by_arrival(parts),
    ]
    return CaptureData(
        capture_id=firing.order.capture_id,
        shots=firing.order.shots,
        interval_us=firing.order.interval_us,
        fired_at=firing.fired_at,
        fired_host_ns=firing.fired.middle_ns,
        request=firing.request,
        report=firing.report,
        shots_done=shots,
        parts=parts,
        absent=firing.absent,
        faults=tuple(faults),
    )


def _shots_done(firing: Firing) -> int:
    """How many shots there were; a lost box is taken to have made them all until shown wrong."""
    report = firing.report
    if report is None or report.outcome is FireOutcome.UNKNOWN:
        return firing.order.shots
    return report.shots_done


def _require_fired(firing: Firing, parts: tuple[CameraPart, ...]) -> None:
    if firing.report is None or firing.report.outcome is not FireOutcome.UNKNOWN:
        return
    if not any(part.pairing.pairs for part in parts):
        raise DeviceError(
            "trigger-unknown",
            "whether the box fired cannot be told, and no camera gave a picture "
            f"({firing.report.why or 'the box was lost'})",
            "see to the box, then take a new capture under another id",
        )


def _by_arrival(parts: Sequence[CameraPart]) -> list[Fault]:
    """Said once for the whole rig: it is true of every picture of such cameras."""
    names = [p.plan.name for p in parts if any(o.method is Method.ARRIVAL for o in p.pairing.pairs)]
    if not names:
        return []
    text = f"the pictures of {', '.join(names)} were given to the shots by order of arrival only"
    young = [p.plan.name for p in parts if p.plan.name in names and _clock_comes_later(p)]
    if young:
        text += f"; the clock of {', '.join(young)} is learned from its pictures: fire twice"
    return [Fault(FaultKind.BY_ARRIVAL, text)]


def _clock_comes_later(part: CameraPart) -> bool:
    """Whether a camera that stamps its frames and cannot be asked the time was fired first now."""
    stamps = part.received.capabilities.timestamps is TimestampKind.DEVICE
    asked = part.received.clock is not None or part.received.clock_jumped
    return stamps and not asked and part.plan.output is None


def _stopped(firing: Firing, shots: int) -> list[Fault]:
    report = firing.report
    if report is not None and report.outcome is FireOutcome.UNKNOWN:
        why = f" ({report.why})" if report.why else ""
        text = f"the trigger box was lost before it could tell{why}"
        return [Fault(FaultKind.BOX_LOST, f"{text}: only the pictures show what was fired")]
    if shots >= firing.order.shots:
        return []
    why = firing.report.why if firing.report is not None else ""
    text = f"the burst was stopped after {shots} of {firing.order.shots} shots"
    return [Fault(FaultKind.NOT_FIRED, f"{text} ({why})" if why else text)]


def _part(
    station: Station,
    firing: Firing,
    thread: CameraThread,
    fit: ClockFitter,
    sizes: Sizes,
    shots: int,
) -> CameraPart:
    name = thread.plan.name
    got, ready = firing.collected[name], firing.ready[name]
    capabilities = thread.device.capabilities
    samples = (*ready.clock_samples, *got.clock_samples)
    clock, jumped = _clock(samples, fit)
    plan = _with_known_lag(thread.plan, capabilities)
    pictures = tuple(frame for frame in got.frames if not is_raw(frame))
    raws = tuple(frame for frame in got.frames if is_raw(frame))
    received = CameraFrames(
        camera=name,
        capabilities=capabilities,
        frames=pictures or raws,
        trigger_times=_trigger_times(station, firing, thread.plan, capabilities, got, shots),
        armed_host_ns=ready.armed_host_ns,
        clock=clock,
        clock_jumped=jumped,
        lag_us=plan.expected_lag_us,
        lag_tolerance_us=plan.lag_tolerance_us,
        deadline_s=station.policy.frame_deadline_s,
        asked_host_ns=got.asked_ns,
    )
    judged = _judged(_pair_if_shot(received), sizes.get(name))
    paired = _explained(_accounted(judged, shots), got.problem)
    beside = _pair_if_shot(replace(received, frames=raws)) if pictures and raws else None
    return CameraPart(
        thread.plan, thread.device.info, ready.settings, received, paired, beside, samples
    )


def _by_files(
    station: Station,
    firing: Firing,
    parts: tuple[CameraPart, ...],
    evidence: FileEvidence,
    sizes: Sizes,
) -> tuple[CameraPart, ...]:
    """The same with the files of cameras that are only seen through them given to their shots."""
    wall_ns = round(firing.fired_at.timestamp() * 1e9) - firing.fired.middle_ns
    given = {
        part.plan.name: _delivery(station, firing, part, wall_ns)
        for part in parts
        if part.received.capabilities.by_files and part.received.trigger_times
    }
    found = evidence.sort(list(given.values()))
    done = []
    for part in parts:
        if part.plan.name in found:
            pairing, raws = found[part.plan.name]
            faults = (*pairing.faults, *late_faults(part.received, pairing.pairs))
            judged = _judged(replace(pairing, faults=faults), sizes.get(part.plan.name))
            got = firing.collected[part.plan.name]
            part = replace(
                part,
                pairing=_explained(judged, got.problem),
                raws=raws,
                unfiled=_unfiled(given[part.plan.name], pairing, raws),
            )
        done.append(part)
    return tuple(done)


def _unfiled(given: FileDelivery, pairing: Pairing, raws: Pairing | None) -> tuple[Frame, ...]:
    """What came after the first shot and has no place."""
    pairs = (*pairing.pairs, *(() if raws is None else raws.pairs))
    after = (f for f in given.frames if f.arrived_host_ns >= given.first_host_ns)
    return tuple(f for f in after if all(f is not one.frame for one in pairs))


def _delivery(station: Station, firing: Firing, part: CameraPart, wall_ns: int) -> FileDelivery:
    received, capture_id = part.received, firing.order.capture_id
    first = received.trigger_times[0]
    return FileDelivery(
        camera=part.plan.name,
        frames=firing.collected[part.plan.name].frames,
        between=firing.collected[part.plan.name].between,
        shots=tuple(
            FiredShot(capture_id, t.shot, t.at_host_ns + wall_ns + round(received.lag_us * 1e3))
            for t in received.trigger_times
        ),
        first_host_ns=first.at_host_ns - round(first.uncertainty_us * 1e3),
        wait_ns=file_wait_ns(station.policy, received.capabilities),
        kinds=part.plan.kinds,
    )


def _pair_if_shot(received: CameraFrames) -> Pairing:
    """The pairing, with deadlines; a burst that was stopped before its first shot has none."""
    return pair(received) if received.trigger_times else Pairing(received.camera, (), ())


def _with_known_lag(plan: CameraPlan, capabilities: CameraCapabilities) -> CameraPlan:
    """The camera's own word on its lag, where the station file has none."""
    delay = capabilities.exposure_start_delay_us
    if plan.expected_lag_us == 0.0 and delay is not None:
        return replace(plan, expected_lag_us=delay)
    return plan


def _clock(samples: tuple[ClockSample, ...], fit: ClockFitter) -> tuple[DeviceClock | None, bool]:
    if clock_jumped(samples):
        return None, True
    return fit(samples) if samples else None, False


def _trigger_times(
    station: Station,
    firing: Firing,
    plan: CameraPlan,
    capabilities: CameraCapabilities,
    got: Collected,
    shots: int,
) -> tuple[TriggerTime, ...]:
    if capabilities.trigger is TriggerKind.SOFTWARE:
        return _command_times(got)
    return edge_times(station, plan, firing.report, firing.fired, shots, firing.order.interval_us)


def _command_times(got: Collected) -> tuple[TriggerTime, ...]:
    """When a camera was told over its bus.

    A command that failed may have been carried out all the same. It counts where the camera's
    stamps can tell, or where more pictures came than commands went well; else a camera that made
    what it could would lose its good pictures to a shot that it never made.
    """
    well = [command for command in got.sent if not command.problem]
    stamped = all(frame.device_ns is not None for frame in got.frames)
    counted = got.sent if stamped or len(got.frames) > len(well) else well
    return command_times({command.shot: command.at for command in counted})


def _accounted(pairing: Pairing, shots: int) -> Pairing:
    """The same with a fault for each shot that lacks its picture and has none yet."""
    told = {fault.shot for fault in pairing.faults if not fault.harmless}
    if None in told:
        return pairing
    silent = [
        Fault(
            FaultKind.MISSING, f"{pairing.camera}: no picture of shot {shot}", pairing.camera, shot
        )
        for shot in range(1, shots + 1)
        if pairing.pair(shot) is None and shot not in told
    ]
    return replace(pairing, faults=(*pairing.faults, *silent))


def _judged(pairing: Pairing, size_px: tuple[int, int] | None) -> Pairing:
    return replace(pairing, faults=(*pairing.faults, *image_faults(pairing, size_px)))


def _explained(pairing: Pairing, problem: str) -> Pairing:
    """The camera's own word on why pictures are missing, where it has one."""
    if not problem:
        return pairing
    faults = tuple(
        replace(fault, text=f"{fault.text} ({problem})")
        if fault.kind in (FaultKind.MISSING, FaultKind.FILE_MISSING)
        else fault
        for fault in pairing.faults
    )
    return replace(pairing, faults=faults)
