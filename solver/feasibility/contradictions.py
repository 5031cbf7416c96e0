"""Contradictions between limits that hold whatever the design.

Looked at are places 8 degrees apart all around the subject, and in small zones. Everything is
taken so leniently that what is found hopeless here is hopeless between the places too; what is
not found so may still turn out to be.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Floats
from geometry.camera import Camera
from geometry.subject import Subject
from solver.feasibility.places import FINER_DEG, NEARER, STEP_DEG, Places, all_around
from solver.limits import Box, HalfSpace, Limits, Sphere, Zone
from solver.zones import in_rig_frame

_PAIR = 2
_SHARE_MARGIN = 0.01


@dataclass(frozen=True)
class Hopeless:
    """Limits that contradict each other whatever the design: which, and what to relax.

    ``families``: the first words of their rows in the table of limits.
    """

    problem: str
    remedy: str
    families: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.problem}; {self.remedy}"


def hopeless(subject: Subject, camera: Camera, limits: Limits, count: int) -> Hopeless | None:
    """The first contradiction between the limits of a rig of ``count`` cameras; None for none."""
    for step_deg in (STEP_DEG, FINER_DEG):
        found = Places(subject, camera, limits, step_deg)
        for check in (_rooms, _bodies, _means, _standing, _cells, _seeing, _covering, _apart):
            for told in check(found, count):
                return told
        if not found.scarce:
            break
    return None


def _stand_off(limits: Limits) -> str:
    low, high = limits.stand_off.min_mm, limits.stand_off.max_mm
    if low is None and high is None:
        return "whatever the distance"
    if high is None:
        return f"limits.stand_off at {low:g} mm or more"
    return f"limits.stand_off at {low or 0.0:g} to {high:g} mm"


def _rooms(found: Places, count: int) -> Iterator[Hopeless]:
    """Zones too small for the bodies."""
    zones = in_rig_frame(found.limits.zones, found.subject).allowed
    size = found.camera.body.size_mm
    if not zones or not all(isinstance(zone, Box | Sphere) for zone in zones):
        return
    room = 0.0
    for zone in zones:
        if isinstance(zone, Box):
            sides = zone.high_mm - zone.low_mm
            room += float(np.prod(sides)) if sides.min() >= size.min() else 0.0
        elif isinstance(zone, Sphere) and 2.0 * zone.radius_mm >= size.min():
            room += 4.0 / 3.0 * np.pi * zone.radius_mm**3
    clearance = found.limits.body_clearance_mm
    need = float(np.prod(size)) * (count if clearance is not None else 1)
    if room < need:
        yield Hopeless(
            f"the allowed zones of limits.zones hold {room / 1e6:.3g} litres, but {count} bodies "
            f"of {' x '.join(f'{v:g}' for v in size)} mm need {need / 1e6:.3g}",
            "allow larger zones or fewer cameras",
            ("zone",),
        )


def _cells(found: Places, count: int) -> Iterator[Hopeless]:
    """Zones that hold fewer cameras than are to stand there so far apart.

    Two cameras in a cell are nearer to each other than its diagonal, so there is one in each.
    """
    limits = found.limits
    zones = in_rig_frame(limits.zones, found.subject).allowed
    if not zones or any(isinstance(zone, HalfSpace) for zone in zones) or not len(found.places):
        return
    height = max(float(found.distance_mm.min()), limits.stand_off.min_mm or 0.0)
    ratio, gap = limits.base_height.min or 0.0, limits.body_clearance_mm
    bodies = 0.0 if gap is None else gap + float(found.camera.body.size_mm.min())
    need = max(ratio * height, bodies)
    most = sum(_cells_of(zone, need) for zone in zones)
    if most < count:
        why = "limits.base_height.min" if ratio * height >= bodies else "limits.bodies"
        yield Hopeless(
            f"{why} keeps cameras {need:.0f} mm apart, so the allowed zones of limits.zones hold "
            f"{most} at most, but {count} are to stand there",
            "allow larger zones, a smaller distance between cameras, or fewer of them",
            ("zone", "base_height", "body_clearance"),
        )


def _cells_of(zone: Zone, need_mm: float) -> float:
    """Least number of cells of a zone's box whose diagonal is below ``need_mm``."""
    if isinstance(zone, HalfSpace) or need_mm <= 0.0:
        return np.inf
    sides = (
        zone.high_mm - zone.low_mm if isinstance(zone, Box) else np.full(3, 2.0 * zone.radius_mm)
    )
    parts = np.stack(np.meshgrid(*[np.arange(1, 9)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    fits = parts[np.linalg.norm(sides / parts, axis=1) < need_mm]
    return float(fits.prod(axis=1).min()) if len(fits) else np.inf


def _bodies(found: Places, count: int) -> Iterator[Hopeless]:
    """Neighbours that must be nearer to each other than their bodies let them."""
    limits, smallest = found.limits, float(found.camera.body.size_mm.min())
    ratios = limits.base_height
    far, gap = limits.stand_off.max_mm, limits.body_clearance_mm
    reach = min(np.inf if far is None else far, found.farthest_mm)
    for key, ratio in (("neighbour_max", ratios.neighbour_max), ("max", ratios.max)):
        if count < _PAIR or ratio is None or gap is None or ratio * reach >= smallest + gap:
            continue
        yield Hopeless(
            f"limits.base_height.{key} is {ratio:g} at up to {reach:.0f} mm, which puts "
            f"neighbours {ratio * reach:.0f} mm apart at most, but their bodies need "
            f"{smallest + gap:.0f} mm with limits.bodies.clearance_mm",
            f"allow a greater {key}, a smaller clearance, or smaller bodies",
            ("base_height", "body_clearance"),
        )
    spacing = limits.spacing
    if (
        spacing is not None
        and far is not None
        and spacing.edge_mm - spacing.tolerance_mm > 2.0 * far
    ):
        yield Hopeless(
            f"limits.spacing asks for edges of {spacing.edge_mm:g} mm, but within "
            f"limits.stand_off.max_mm = {far:g} no two cameras are farther apart than "
            f"{2.0 * far:g} mm",
            "give a shorter edge_mm or a greater stand-off",
            ("spacing", "stand_off"),
        )


def _means(found: Places, _count: int) -> Iterator[Hopeless]:
    """A mean incidence below that of the best axis of all."""
    most = found.limits.incidence.mean_max_deg
    if most is None:
        return
    cosine = np.clip(all_around(found.step_deg) @ found.points.normals.T, -1.0, 1.0)
    least = float(np.degrees(np.arccos(cosine)).mean(axis=1).min())
    if least - found.between_deg > most:
        yield Hopeless(
            f"limits.incidence.mean_max_deg is {most:g}, but the subject's normals spread so far "
            f"that no axis meets them at less than {least:.0f} degrees on average",
            f"allow {least + 3.0:.0f} degrees or more",
            ("incidence",),
        )


def _standing(found: Places, _count: int) -> Iterator[Hopeless]:
    """No place at all, or none that can have what it sees in frame, sharp and fine enough."""
    limits = found.limits
    if not len(found.places):
        yield Hopeless(
            f"limits.zones leave no place for a camera, with {_stand_off(limits)}",
            "allow other zones, forbid smaller ones, or change the stand-off",
            ("zone", "stand_off"),
        )
        return
    if not found.useful.any():
        yield Hopeless(
            f"no camera sees anything from where limits.zones and limits.stand_off let it stand, "
            f"with rays up to limits.incidence.ray_max_deg = {limits.incidence.ray_max_deg:g}",
            "allow zones before the subject or a greater angle",
            ("zone", "stand_off", "coverage"),
        )
        return
    if found.standing.any():
        return
    yield _too_near(found, "no camera can have what it sees in frame, sharp and fine enough")


def _too_near(found: Places, first: str) -> Hopeless:
    """Distances that frame, focus, stand-off and pixel size ask for together."""
    limits, useful = found.limits, found.useful
    framed = float(np.median(found.framed_mm[useful]))
    sharp = float(np.median(found.sharp_mm[useful]))
    nearest, farthest = float(found.distance_mm.min()), float(found.distance_mm.max())
    fine = found.farthest_mm
    shorter = "choose a shorter lens"
    options = (
        (
            limits.depth_of_field and sharp > max(1.01 * framed, NEARER * min(farthest, fine)),
            f"limits.depth_of_field asks for about {sharp:.0f} mm or more",
            "stop down (a greater f_number)",
        ),
        (
            limits.frame is not None and framed > NEARER * min(farthest, fine),
            f"limits.frame asks for about {framed:.0f} mm or more",
            shorter,
        ),
        (
            fine < max(sharp, nearest),
            f"limits.gsd.max_mm asks for about {fine:.0f} mm or less",
            "allow larger pixels",
        ),
        (
            farthest < sharp or nearest > fine,
            f"limits.stand_off and limits.zones leave {nearest:.0f} to {farthest:.0f} mm",
            "allow another stand-off or other zones",
        ),
    )
    told = [words for true, words, _ in options if true]
    remedies = dict.fromkeys(remedy for true, _, remedy in options if true)
    families = ("depth_of_field", "frame", "gsd", "stand_off", "zone")
    return Hopeless(f"{first}: {', '.join(told)}", " or ".join(remedies), families)


def _seeing(found: Places, _count: int) -> Iterator[Hopeless]:
    """A share of points that cannot be seen from anywhere."""
    tiers = found.limits.coverage.tiers
    most = max((tier.share for tier in tiers), default=0.0)
    anyhow = float(found.may_see[found.useful].any(axis=0).mean())
    there = float(found.may_see[found.standing].any(axis=0).mean())
    asked = f"limits.coverage asks for {100.0 * most:g} % of the points"
    angle = f"limits.incidence.ray_max_deg = {found.limits.incidence.ray_max_deg:g}"
    if anyhow < most - _SHARE_MARGIN:
        where = (
            " and limits.zones"
            if found.limits.zones.allowed or found.limits.zones.forbidden
            else ""
        )
        yield Hopeless(
            f"{asked}, but {angle}{where} let {100.0 * anyhow:.1f} % be seen from anywhere",
            "ask for a smaller share, allow a greater angle or other zones, or leave out what is "
            "hidden with [subject]",
            ("coverage",),
        )
    elif there < most - _SHARE_MARGIN:
        yield _too_near(found, f"{asked}, but {100.0 * there:.1f} % can be had as the limits ask")


def _covering(found: Places, count: int) -> Iterator[Hopeless]:
    """More views asked for than so many cameras have."""
    tiers = found.limits.coverage.tiers
    views = max((tier.views for tier in tiers), default=0)
    needed = sum(max(tier.share for tier in tiers if tier.views >= v) for v in range(1, views + 1))
    widest = float(found.may_see[found.standing].mean(axis=1).max())
    if count * widest < needed - _SHARE_MARGIN:
        yield Hopeless(
            f"limits.coverage asks for {needed:.2f} views of a point on average, but {count} "
            f"cameras that see {100.0 * widest:.0f} % of the points at most, with "
            f"limits.incidence.ray_max_deg = {found.limits.incidence.ray_max_deg:g}, make "
            f"{count * widest:.2f}",
            "ask for less, allow a greater angle, or give "
            f"{int(np.ceil(needed / widest))} cameras or more",
            ("coverage",),
        )


def _apart(found: Places, count: int) -> Iterator[Hopeless]:
    """More cameras than there is room for, so far apart as they must be."""
    limits, places = found.limits, found.places[found.standing]
    away = found.distance_mm[found.standing]
    least = limits.base_height.min
    if least is not None and count > 1:
        most = _count_apart(places, away, least - 2.0 * found.between_ratio)
        widest = _widest(places, away)
        if widest + found.between_ratio < least or most < count:
            room = (
                f"{widest:.2f} at most"
                if widest + found.between_ratio < least
                else f"room for {most}"
            )
            yield Hopeless(
                f"limits.base_height.min is {least:g} for {count} cameras, but where they can "
                f"stand there is {room}",
                "give a smaller ratio, fewer cameras, or more room (stand_off, zones, ray_max_deg)",
                ("base_height",),
            )
    gap = limits.body_clearance_mm
    if gap is not None and count > 1 and limits.stand_off.max_mm is not None:
        need = gap + float(found.camera.body.size_mm.min())
        step = found.between_ratio * float(away.max())
        most = _count_apart(places, np.ones(len(places)), need - 2.0 * step)
        if most < count:
            yield Hopeless(
                f"limits.bodies.clearance_mm is {gap:g} for {count} cameras, but where they can "
                f"stand there is room for {most}",
                "give a smaller clearance, fewer cameras, or more room (stand_off, zones)",
                ("body_clearance",),
            )


def _widest(places_mm: Floats, height_mm: Floats) -> float:
    """Greatest base/height between any two of the places, of some hundreds of them."""
    some = np.arange(len(places_mm))[:: max(1, len(places_mm) // 600)]
    gap = np.linalg.norm(places_mm[some, None] - places_mm[None, some], axis=2)
    return float((2.0 * gap / (height_mm[some, None] + height_mm[None, some])).max())


def _count_apart(places_mm: Floats, height_mm: Floats, need: float) -> int:
    """At most so many cameras can be ``need`` from each other.

    Distances are divided by the mean of the two heights (m,). Places are put into sets of which
    no two members are so far apart, and of each set one camera at most can be.
    """
    if need <= 0.0:
        return len(places_mm) + 1
    left, count = np.ones(len(places_mm), dtype=np.bool_), 0
    while left.any():
        first = int(np.argmax(left))
        order = np.argsort(_apart_from(places_mm, height_mm, first), kind="stable")
        fits = left.copy()
        for k in order:
            if fits[k]:
                left[k] = False
                fits &= _apart_from(places_mm, height_mm, int(k)) < need
        count += 1
    return count


def _apart_from(places_mm: Floats, height_mm: Floats, one: int) -> Floats:
    gap = np.linalg.norm(places_mm - places_mm[one], axis=1)
    return np.asarray(2.0 * gap / (height_mm + height_mm[one]))
