"""Files that are told instead of filed: copies, those of others, and what their shots lack."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rig.acquisition.cameras.base import Frame
from rig.acquisition.synchrony.cameraframes import Method, Pair, Pairing
from rig.acquisition.synchrony.faults import Fault, FaultKind
from rig.acquisition.synchrony.fileclocks import FileDelivery
from rig.acquisition.synchrony.fileexposures import FileExposure


def hold(given: FileDelivery, exposure: FileExposure, why: str, faults: list[Fault]) -> None:
    """Tell that the files of an exposure are held back, and why."""
    names = ", ".join(frame.metadata.get("file", "a file") for frame in exposure.frames)
    text = f"{given.camera}: {names} is held back: {why}"
    faults.append(Fault(FaultKind.HELD_BACK, text, given.camera))


def owners_of(
    deliveries: Sequence[FileDelivery], serials: Mapping[str, str]
) -> dict[str, frozenset[str]]:
    """The cameras that a content came for, where it came for several: those it may be of."""
    came: dict[str, dict[str, Frame]] = {}
    for one in deliveries:
        for frame in one.frames:
            came.setdefault(frame.metadata.get("sha256", ""), {})[one.camera] = frame
    owners = {}
    for content, frames in came.items():
        if content and len(frames) > 1:
            body = next(iter(frames.values())).metadata.get("BodySerialNumber", "")
            named = frozenset(name for name in frames if body and serials[name] == body)
            owners[content] = named if len(named) == 1 else frozenset()
    return owners


def own_frames(
    given: FileDelivery,
    serial: str,
    owners: Mapping[str, frozenset[str]],
    seen: Mapping[str, str],
    faults: list[Fault],
) -> list[Frame]:
    """The frames without copies, and without what is of another body or from before the shot.

    ``serial``: the camera's body, empty when it is not known; ``seen``: files of earlier captures
    by their content.
    """
    own: dict[str, Frame] = {}
    for number, frame in enumerate(given.frames):
        tags, lone = frame.metadata, FileExposure((frame,), None)
        content = tags.get("sha256", str(number))
        body = tags.get("BodySerialNumber", "")
        if content in own:
            text = f"{given.camera}: {lone.name} is the same file once more; it is kept once"
            faults.append(Fault(FaultKind.DUPLICATE, text, given.camera))
        elif tags.get("known_as") or content in seen:
            hold(given, lone, f"it is {tags.get('known_as') or seen[content]} once more", faults)
        elif tags.get("last_written"):
            why = f"it tells no time, and was last written {tags['last_written']}: an old file"
            hold(given, lone, f"{why}; let the camera write times", faults)
        elif content in owners and given.camera not in owners[content]:
            hold(given, lone, "the same file came for another camera", faults)
        elif body and serial and body != serial:
            hold(given, lone, f"it is of the body {body}, not of {serial}", faults)
        elif frame.arrived_host_ns < given.first_host_ns:
            text = f"{given.camera}: a picture that came before the first shot is left out"
            faults.append(Fault(FaultKind.EXTRA_AT_START, text, given.camera))
        else:
            own[content] = frame
    return list(own.values())


def pairings(
    given: FileDelivery,
    found: Mapping[int, tuple[FileExposure, Method]],
    faults: list[Fault],
) -> tuple[Pairing, Pairing | None]:
    """What was found, the raw files beside it, and a fault for what each shot lacks."""
    pairs, beside = [], []
    for shot in given.shots:
        if shot.shot not in found:
            text = f"{given.camera}: no picture of shot {shot.shot}"
            faults.append(Fault(FaultKind.MISSING, text, given.camera, shot.shot))
            continue
        exposure, method = found[shot.shot]
        first, *others = (Pair(shot.shot, frame, method) for frame in exposure.frames)
        pairs.append(first)
        beside += others
        for kind in sorted(given.kinds - {frame.media_type for frame in exposure.frames}):
            text = f"{given.camera}: shot {shot.shot} brought no file of the kind {kind}"
            faults.append(Fault(FaultKind.FILE_MISSING, text, given.camera, shot.shot))
    raws = Pairing(given.camera, tuple(beside), ()) if beside else None
    return Pairing(given.camera, tuple(pairs), tuple(faults)), raws
