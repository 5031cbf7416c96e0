"""Whole frames against PyNiteFEA: its beams, on a model that is read from the structure anew."""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import numpy as np
import pytest
from held_mounts import held
from Pynite import FEModel3D

from geometry.arrays import Floats
from rig.build.mounts.structure import Member, Structure, levelling_feet
from rig.build.mounts.systems.base import Built
from rig.build.parts.masses import small_part_g
from rig.build.parts.screws import sized
from rig.build.statics.sag import sags
from rig.build.statics.weights import Masses
from rig.catalogue import load_catalogue

CATALOGUE = load_catalogue()
GRAVITY_M_S2 = 9.81
CAMERA_KG = 1.0
STIFF = 2e6
NEAR_MM = 0.01


class OtherFrame:
    """Nodes where members are joined, and stiff rods between middle lines that do not meet."""

    def __init__(self, structure: Structure) -> None:
        self.model, self.places = FEModel3D(), list[Floats]()
        self.model.add_material("metal", 70_000.0, 70_000.0 / 2.66, 0.33, 0.0)
        self.model.add_section("stiff", 1e5, STIFF, STIFF, STIFF)
        self.members = {m.id: m for m in structure.members}
        stops: dict[str, list[Floats]] = {m.id: [*m.axis_mm] for m in structure.members}
        self.rods = 0
        for joint in structure.joints:
            ends = [i for i in (joint.on, joint.other) if i in self.members]
            points = [nearest(self.members[i], joint.point_mm) for i in ends]
            for member, point in zip(ends, points, strict=True):
                stops[member].append(point)
            if len(points) == 2 and np.linalg.norm(points[0] - points[1]) > NEAR_MM:
                self._bar(points[0], points[1], "stiff", 0.0)
        for member in structure.members:
            start = member.axis_mm[0]
            along = sorted(stops[member.id], key=lambda p: float(np.linalg.norm(p - start)))
            for one, other in itertools.pairwise(along):
                if np.linalg.norm(other - one) > NEAR_MM:
                    self._bar(one, other, *self._section(member))
        feet = {m.id for m in structure.members if m.role.split()[-1] == "foot"}
        for member, _, part in levelling_feet(structure):
            if member.id in feet:
                at = nearest(member, part.rig_from_part[:3, 3])
                self.model.def_support(self.node(at), True, True, True, False, False, False)

    def node(self, point: Floats) -> str:
        for k, place in enumerate(self.places):
            if np.linalg.norm(place - point) < NEAR_MM:
                return f"n{k}"
        self.places.append(point)
        name = f"n{len(self.places) - 1}"
        self.model.add_node(name, *(float(v) for v in point))
        return name

    def _bar(self, one: Floats, other: Floats, section: str, n_per_mm: float) -> None:
        name = f"b{len(self.model.members)}"
        self.model.add_member(name, self.node(one), self.node(other), "metal", section)
        if n_per_mm:
            self.model.add_member_dist_load(name, "FZ", -n_per_mm, -n_per_mm)

    def _section(self, member: Member) -> tuple[str, float]:
        profile = CATALOGUE.profiles[member.part]
        # Square profiles only: which way round they lie does not matter.
        assert profile.inertia_x_mm4 == profile.inertia_y_mm4
        inertia, mass = float(profile.inertia_x_mm4 or 0.0), float(profile.mass_kg_per_m or 0.0)
        if profile.id not in self.model.sections:
            torsion = profile.torsion_mm4 or 0.2 * inertia
            self.model.add_section(profile.id, mass / 2.7 * 1e3, inertia, inertia, torsion)
        return profile.id, mass * 1e-3 * GRAVITY_M_S2

    def hang(self, at: Floats, weight_at: Floats, mass_kg: float) -> None:
        force = np.array([0.0, 0.0, -mass_kg * GRAVITY_M_S2])
        moment = np.cross(weight_at - at, force)
        for way, value in zip(("FZ", "MX", "MY", "MZ"), (force[2], *moment), strict=True):
            self.model.add_node_load(self.node(at), way, float(value))

    def moved(self, at: Floats, eye: Floats) -> Floats:
        node = self.model.nodes[self.node(at)]
        shift, turn = (
            np.array([getattr(node, f"{kind}{axis}")["Combo 1"] for axis in "XYZ"]) for kind in "DR"
        )
        return np.asarray(shift + np.cross(turn, eye - at))


def nearest(member: Member, point: Floats) -> Floats:
    start, end = member.axis_mm
    way = (end - start) / np.linalg.norm(end - start)
    return np.asarray(
        start + np.clip((point - start) @ way, 0.0, np.linalg.norm(end - start)) * way
    )


def shifts(built: Built) -> Mapping[str, Floats]:
    """How each camera's centre moves, by the other program."""
    structure, masses = built.structure, Masses(CATALOGUE, CAMERA_KG)
    frame = OtherFrame(structure)
    joints = {joint.id: joint for joint in structure.joints}
    holders = {}
    for mount in built.mounts:
        own = {p.id for p in structure.parts if p.camera == mount.name}
        holds = next(j for j in structure.joints if j.on in frame.members and j.other in own)
        at = holders[mount.name] = nearest(frame.members[holds.on], holds.point_mm)
        centre = mount.camera.pose.to_rig(mount.camera.camera.body.centre_camera_mm[None])[0]
        frame.hang(at, centre, masses.of_camera(mount.camera))
    for part in structure.parts:
        at = holders.get(part.camera)
        if at is None and part.joint in joints:
            joint = joints[part.joint]
            at = nearest(frame.members[joint.on], joint.point_mm)
        if at is not None:
            frame.hang(at, part.rig_from_part[:3, 3], masses.of_part(part.part))
    for joint in structure.joints:
        end = next((e for e in (joint.on, joint.other) if e in frame.members), None)
        if end is not None:
            made = sized(joint, structure, CATALOGUE)
            mass_g = sum((small_part_g(p, long, CATALOGUE) or 0.0) * n for p, long, n in made)
            at = nearest(frame.members[end], joint.point_mm)
            frame.hang(at, joint.point_mm, mass_g / 1e3)
    frame.model.analyze_linear()
    return {
        mount.name: frame.moved(holders[mount.name], mount.camera.pose.position_rig_mm)
        for mount in built.mounts
    }


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "stays"), [("t-slot", False), ("t-slot", True), ("arc", True)])
def test_a_rig_sinks_as_another_program_says(kind: str, *, stays: bool) -> None:
    """Joints are rods as stiff in both: what is left is rounding of two solvers, 4e-6 found."""
    holding = held(kind)
    built = (holding.with_stays() if stays else holding).build()
    theirs = shifts(built)
    for sag in sags(built.structure, built.mounts, (), Masses(CATALOGUE, CAMERA_KG)):
        size = float(np.linalg.norm(theirs[sag.camera]))
        assert size > 0.05, "something gives way"
        off = float(np.linalg.norm(sag.shift_mm - theirs[sag.camera]))
        assert off < 1e-3 * size, (sag.camera, sag.shift_mm, theirs[sag.camera])
