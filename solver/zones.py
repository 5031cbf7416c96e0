"""Zones in the rig frame, whatever they are given about."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from geometry.arrays import Bools, Floats
from geometry.subject import Subject
from solver.limits import Box, HalfSpace, Sphere, Zone, ZoneOrigin, Zones

_BESIDE_MM = 100.0
"""An origin this near to the scan is the scan's own: a centre of the head, a foot of a stand."""


def origin_of(zones: Zones, subject: Subject) -> ZoneOrigin:
    """What zones are about that do not say it.

    The rig frame's origin where it lies in the scan or beside it, and where nothing but points
    is given; a scan that stands elsewhere has an origin that has nothing to do with the head.
    """
    if zones.about is not None:
        return zones.about
    if not len(subject.occluder.vertices_mm):
        return ZoneOrigin.RIG
    low, high = subject.occluder.extent_mm
    low, high = low - _BESIDE_MM, high + _BESIDE_MM
    return ZoneOrigin.RIG if bool(((low <= 0.0) & (high >= 0.0)).all()) else ZoneOrigin.HEAD


def in_rig_frame(zones: Zones, subject: Subject) -> Zones:
    """The same zones with the coordinates that they have in the rig frame."""
    if not (zones.allowed or zones.forbidden) or origin_of(zones, subject) is ZoneOrigin.RIG:
        return zones
    by = subject.foremost_mm
    return Zones(
        tuple(_moved(zone, by) for zone in zones.allowed),
        tuple(_moved(zone, by) for zone in zones.forbidden),
        ZoneOrigin.RIG,
    )


def inside_any(zones: tuple[Zone, ...], places_mm: Floats) -> Bools:
    """Which places (m, 3) lie in any of the zones, (m,)."""
    out = np.zeros(len(places_mm), dtype=np.bool_)
    for zone in zones:
        if isinstance(zone, HalfSpace):
            out |= places_mm @ zone.normal >= zone.offset_mm
        elif isinstance(zone, Sphere):
            out |= np.linalg.norm(places_mm - zone.centre_mm, axis=1) <= zone.radius_mm
        else:
            out |= ((places_mm >= zone.low_mm) & (places_mm <= zone.high_mm)).all(axis=1)
    return out


def _moved(zone: Zone, by_mm: Floats) -> Zone:
    if isinstance(zone, Box):
        return Box(zone.low_mm + by_mm, zone.high_mm + by_mm)
    if isinstance(zone, Sphere):
        return replace(zone, centre_mm=zone.centre_mm + by_mm)
    return HalfSpace(zone.normal, zone.offset_mm + float(np.dot(zone.normal, by_mm)))
