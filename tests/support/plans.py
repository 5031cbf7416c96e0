"""Small mount plans made by hand: a T-slot frame with heads, a plate with printed wedges."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from geometry.camera import Body, Camera, RigCamera
from geometry.frames import Pose
from rig.build.mounts.plan import Figures, MountPlan, Price, Tolerance
from rig.build.mounts.settings import (
    CameraMount,
    Link,
    Motion,
    Setting,
    Tape,
    chain_pose,
    rig_from_camera,
    shift,
    turn,
)
from rig.build.mounts.structure import (
    Hole,
    Joint,
    Member,
    PlacedPart,
    Plate,
    Solid,
    Structure,
    Wedge,
)
from rig.build.wedges import wedge_corners_mm
from rig.solids.bodies import place_body
from rig.solids.convex import box_corners

KIND = Camera(
    "basler-aca2500-14u canon-ef-50-f14",
    (2448, 2048),
    0.00345,
    16.0,
    8.0,
    0.0035,
    100.0,
    Body(np.array([29.0, 29.0, 42.0]), np.array([0.0, 0.0, -50.0]), 33.0, 40.0),
)
DATUM = np.array([0.0, -110.0, 0.0])
UP = np.array([0.0, 0.0, 1.0])
LEVEL = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""Columns: the axes of a camera that looks along +Y, in the rig frame."""


def frame(rotation: np.ndarray, origin: np.ndarray) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = origin
    return matrix


def figures(sigma_mm: float) -> Figures:
    return Figures(sigma_mm, 1.6 * sigma_mm, 0.98, 0.91, True)


PRICE = Price(figures(0.050), figures(0.053), figures(0.051))


def bar(name: str, start: np.ndarray, end: np.ndarray, across: np.ndarray, role: str) -> Member:
    return Member(name, "2020", role, np.array([start, end]), across, (20.0, 20.0))


def bar_solid(member: Member) -> Solid:
    start, end = member.axis_mm[0], member.axis_mm[-1]
    along = (end - start) / np.linalg.norm(end - start)
    axes = np.column_stack([member.across, np.cross(along, member.across), along])
    corners = box_corners(np.array([*member.size_mm, np.linalg.norm(end - start)]), np.zeros(3))
    return Solid(member.id, "member", corners @ axes.T + (start + end) / 2.0)


def camera_solids(camera: RigCamera) -> list[Solid]:
    parts = place_body(camera).parts
    kinds = ["camera", "lens"][: len(parts)]
    return [Solid(camera.name, kind, p) for kind, p in zip(kinds, parts, strict=True)]


def tslot_mount(name: str, upright_x: float, values: tuple[float, ...]) -> CameraMount:
    """A camera on an arm of an upright: height, arm, pan, tilt, roll."""
    limits = (
        ("height on upright", "mm", 1.0, 100.0, 1100.0, "lower end of the upright"),
        ("arm length", "mm", 1.0, 40.0, 300.0, "face of the upright to the pan axis"),
        ("pan", "deg", 1.0, -180.0, 180.0, "scale on the head, 0 along +Y, right positive"),
        ("tilt", "deg", 1.0, -90.0, 90.0, "scale on the head, 0 level, up positive"),
        ("roll", "deg", 1.0, -90.0, 90.0, "scale on the head, 0 level, clockwise positive"),
    )
    settings = tuple(
        Setting(n, unit, value, step, low, high, words)
        for (n, unit, step, low, high, words), value in zip(limits, values, strict=True)
    )
    chain = (
        Link(
            frame(np.eye(3), np.array([upright_x, -700.0, -600.0])),
            Motion.SLIDE,
            UP,
            "height on upright",
        ),
        Link(
            shift(np.array([0.0, 10.0, 0.0])), Motion.SLIDE, np.array([0.0, 1.0, 0.0]), "arm length"
        ),
        Link(np.eye(4), Motion.TURN, -UP, "pan"),
        Link(shift(np.array([0.0, 0.0, 60.0])), Motion.TURN, np.array([1.0, 0.0, 0.0]), "tilt"),
        Link(np.eye(4), Motion.TURN, np.array([0.0, 1.0, 0.0]), "roll"),
        Link(frame(LEVEL, np.array([0.0, 30.0, 34.5]))),
    )
    pose = chain_pose(chain, {s.name: s.value for s in settings})
    wanted = Pose(pose.position_rig_mm + np.array([0.3, -0.2, 0.4]), pose.rotation_rig_to_camera)
    camera = RigCamera(name, KIND, pose, 560.0)
    front = float(np.linalg.norm(pose.to_rig(np.array([[0.0, 0.0, 11.0]]))[0] - DATUM))
    tapes = (
        Tape("floor end of the upright", "middle of the arm", values[0]),
        Tape("datum (nose tip)", "middle of the lens front", front),
    )
    carried = (f"upright-{name}", f"arm-{name}", f"head-{name}")
    return CameraMount(camera, wanted, settings, chain, carried, tapes)


def tslot_parts(mount: CameraMount, upright_x: float) -> tuple[list, list, list, list]:
    """Members, parts, joints and solids of one upright with its arm."""
    name, values = mount.name, mount.values()
    foot = np.array([upright_x, -700.0, -600.0])
    level = foot + np.array([0.0, 0.0, values["height on upright"]])
    x = np.array([1.0, 0.0, 0.0])
    upright = bar(f"upright-{name}", foot, foot + np.array([0.0, 0.0, 1200.0]), x, "upright")
    arm = bar(
        f"arm-{name}",
        level + np.array([0.0, 10.0, 0.0]),
        level + np.array([0.0, 10.0 + values["arm length"], 0.0]),
        x,
        "arm",
    )
    at = arm.axis_mm[1] + [0.0, 0.0, 10.0]
    head = PlacedPart(f"head-{name}", "generic-ball-25", "head", shift(at), name)
    joint = Joint(
        f"joint-{name}",
        upright.id,
        arm.id,
        level,
        values["height on upright"],
        None,
        {"cap-screw-m5": 2, "t-nut-2020": 2},
    )
    stands = Joint(f"stud-{name}", arm.id, head.id, at, None, values["pan"], {"stud-1-4-20": 1})
    size = np.array([36.0, 36.0, 45.0])
    solid = Solid(head.id, "head", box_corners(size, np.array([0.0, 0.0, 22.5])) + at)
    solids = [bar_solid(upright), bar_solid(arm), solid, *camera_solids(mount.camera)]
    return [upright, arm], [head], [joint, stands], solids


def tolerances(mounts: tuple[CameraMount, ...]) -> tuple[Tolerance, ...]:
    return tuple(
        Tolerance(m.name, s.name, s.unit, 1.5, float("inf") if s.unit == "deg" else 2.0, "coverage")
        for m in mounts
        for s in m.settings
    )


def tslot_plan(count: int = 2) -> MountPlan:
    """Cameras on uprights that stand on a level bar, side by side."""
    places = 120.0 * (np.arange(count) - (count - 1) / 2.0)
    mounts = tuple(
        tslot_mount(
            f"c{k + 1}",
            float(x),
            (
                560.0 + 20.0 * (k % 3),
                80.0 + 5.0 * (k % 2),
                float(round(-x / 8.0)),
                3.0 * (k % 3) - 3.0,
                2.0 * (k % 2),
            ),
        )
        for k, x in enumerate(places)
    )
    members, parts, joints, solids = [], [], [], []
    for mount, x in zip(mounts, places, strict=True):
        more = tslot_parts(mount, float(x))
        for mine, new in zip((members, parts, joints, solids), more, strict=True):
            mine.extend(new)
    half = max(200.0, float(np.abs(places).max()) + 60.0)
    foot = bar(
        "base",
        np.array([-half, -700.0, -610.0]),
        np.array([half, -700.0, -610.0]),
        np.array([0.0, 1.0, 0.0]),
        "base",
    )
    members.append(foot)
    solids.append(bar_solid(foot))
    for k, x in enumerate(places):
        joints.append(
            Joint(
                f"foot-{k + 1}",
                "base",
                f"upright-c{k + 1}",
                np.array([x, -700.0, -600.0]),
                float(x + half),
                None,
                {"cap-screw-m5": 2, "t-nut-2020": 2},
            )
        )
        parts.append(
            PlacedPart(
                f"corner-{k + 1}", "corner-2020", "corner", shift(np.array([x, -690.0, -600.0]))
            )
        )
    structure = Structure(tuple(members), (), (), tuple(parts), tuple(joints), tuple(solids))
    steps = (
        "Cut the members to the cut list.",
        "Bolt the uprights to the base.",
        *(f"Set {m.name} by its setting sheet." for m in mounts),
    )
    return MountPlan(
        "Face rig",
        "t-slot",
        DATUM,
        structure,
        mounts,
        PRICE,
        tolerances(mounts),
        (),
        0.97,
        200,
        steps,
        ("All lengths in mm.",),
    )


@dataclass(frozen=True)
class Aim:
    """A camera on the plate: where its seat is over the plate, and how it is turned."""

    name: str
    x_mm: float
    y_mm: float
    height_mm: float
    turns_deg: tuple[float, float, float]


AIMS = (
    Aim("left", -90.0, 10.0, 22.0, (8.0, 6.0, -14.0)),
    Aim("right", 90.0, 0.0, 24.0, (0.0, 12.0, 14.0)),
    Aim("top", 0.0, 70.0, 20.0, (0.0, 0.0, 0.0)),
)


def wedge_of(aim: Aim, rig_from_plate: np.ndarray, *, kind: str = "tapped") -> Wedge:
    """A wedge whose seat turns about the plate's x, y and z by the aim's angles."""
    a, b, c = aim.turns_deg
    eye = np.eye(3)
    seat = turn(eye[2], c) @ turn(eye[1], b) @ turn(eye[0], a)
    holes = tuple(
        Hole(f"{aim.name}-{k + 1}", x, 0.0, 5.5, kind, "M5") for k, x in enumerate((-28.0, 28.0))
    )
    return Wedge(
        f"wedge-{aim.name}",
        aim.name,
        rig_from_plate @ shift(np.array([aim.x_mm, aim.y_mm, 0.0])),
        frame(seat, np.array([0.0, 0.0, aim.height_mm])),
        (30.0, 30.0),
        (72.0, 34.0),
        holes,
        "1/4-20",
        6.6,
    )


def plate_mount(aim: Aim, wedge: Wedge) -> CameraMount:
    """The camera stands on its seat and looks along the seat's y."""
    seat = wedge.rig_from_base @ wedge.base_from_seat
    thread = KIND.body.mount_thread_camera_mm
    camera_axes = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    matrix = seat @ frame(camera_axes, -camera_axes @ thread)
    settings = (
        Setting("x on plate", "mm", aim.x_mm, 0.0, -500.0, 500.0, "middle of the plate"),
        Setting("y on plate", "mm", aim.y_mm, 0.0, -500.0, 500.0, "middle of the plate"),
    )
    x, y = np.eye(3)[0], np.eye(3)[1]
    plate = wedge.rig_from_base @ shift(np.array([-aim.x_mm, -aim.y_mm, 0.0]))
    moved = shift(np.array([aim.x_mm, aim.y_mm, 0.0]))
    chain = (
        Link(plate, Motion.SLIDE, x, "x on plate"),
        Link(np.eye(4), Motion.SLIDE, y, "y on plate"),
        Link(np.linalg.inv(plate @ moved) @ matrix),
    )
    pose = chain_pose(chain, {s.name: s.value for s in settings})
    assert np.allclose(rig_from_camera(pose), matrix)
    camera = RigCamera(aim.name, KIND, pose, 560.0)
    front = float(np.linalg.norm(pose.to_rig(np.array([[0.0, 0.0, 11.0]]))[0] - DATUM))
    tapes = (
        Tape("datum (nose tip)", "middle of the lens front", front),
        Tape("left edge of the plate", "middle of the wedge", aim.x_mm + 170.0),
    )
    return CameraMount(camera, pose, settings, chain, ("plate", wedge.id), tapes)


def plate_plan(
    aims: tuple[Aim, ...] = AIMS, half_mm: tuple[float, float] = (170.0, 130.0)
) -> MountPlan:
    """A level plate under the cameras, with a printed wedge for each."""
    rig_from_plate = frame(np.eye(3), np.array([0.0, -560.0, -60.0]))
    wedges = tuple(wedge_of(aim, rig_from_plate) for aim in aims)
    mounts = tuple(plate_mount(aim, wedge) for aim, wedge in zip(aims, wedges, strict=True))
    holes = tuple(
        replace(hole, x_mm=hole.x_mm + aim.x_mm, y_mm=hole.y_mm + aim.y_mm, kind="through")
        for aim, wedge in zip(aims, wedges, strict=True)
        for hole in wedge.base_holes
    )
    w, h = half_mm
    outline = np.array([[-w, -h], [w, -h], [w, h], [-w, h]])
    slot = np.array([[-40.0, -100.0], [40.0, -100.0], [40.0, -70.0], [-40.0, -70.0]])
    plate = Plate("plate", "aluminium", 6.0, rig_from_plate, outline, holes, (slot,))
    solids = [
        Solid(
            "plate",
            "plate",
            box_corners(np.array([2 * w, 2 * h, 6.0]), np.array([0.0, 0.0, -3.0]))
            + rig_from_plate[:3, 3],
        )
    ]
    for mount in mounts:
        solids += camera_solids(mount.camera)
    solids += [Solid(w.id, "wedge", wedge_corners_mm(w)) for w in wedges]
    joints = tuple(
        Joint(
            f"screws-{w.id}",
            "plate",
            w.id,
            w.rig_from_base[:3, 3],
            None,
            None,
            {"cap-screw-m5": 2, "hex-nut-m5": 2, "stud-1-4-20": 1},
        )
        for w in wedges
    )
    structure = Structure((), (plate,), wedges, (), joints, tuple(solids))
    steps = ("Drill the plate.", "Print the wedges.", "Screw the cameras on.")
    return MountPlan(
        "Compact array",
        "plate",
        DATUM,
        structure,
        mounts,
        PRICE,
        tolerances(mounts),
        (),
        0.99,
        200,
        steps,
    )
