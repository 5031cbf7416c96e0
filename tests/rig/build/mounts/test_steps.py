"""The assembly steps name every piece once, in an order in which it can be put together."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from mounted import slider

from rig.build.mounts.settings import CameraMount, Tape
from rig.build.mounts.steps import assembly_steps as steps_with
from rig.build.mounts.structure import Hole, Joint, Member, Plate, Structure, Wedge, joint_side
from rig.catalogue import load_catalogue

ORIGIN = np.zeros(3)


def assembly_steps(made: Structure, mounts: tuple[CameraMount, ...]) -> tuple[str, ...]:
    return steps_with(made, mounts, load_catalogue())


def member(name: str, length_mm: float) -> Member:
    axis = np.array([[0.0, 0.0, 0.0], [length_mm, 0.0, 0.0]])
    return Member(name, "2020", "post", axis, np.array([0.0, 1.0, 0.0]), (20.0, 20.0))


def plate(*holes: Hole) -> Plate:
    outline = np.array([[0.0, 0.0], [400.0, 0.0], [400.0, 300.0], [0.0, 300.0]])
    return Plate("board", "aluminium", 8.0, np.eye(4), outline, holes)


def wedge(camera: str) -> Wedge:
    return Wedge(
        f"{camera} wedge", camera, np.eye(4), np.eye(4), (40.0, 30.0), (40.0, 60.0), (),
        "stud-1-4-20", 6.8,
    )  # fmt: skip


def structure(**parts: object) -> Structure:
    nothing: dict[str, object] = dict.fromkeys(
        ("members", "plates", "wedges", "parts", "joints", "solids"), ()
    )
    return Structure(**(nothing | parts))


def mount(name: str, *carried_by: str, made: bool = False) -> CameraMount:
    found = slider(name, {"x": 12.0, "pan": 1.5}, steps=(0.0, 0.0) if made else (1.0, 0.5))
    tapes = (Tape("datum", f"{name} lens", 912.4), Tape("floor", f"{name} thread", 1500.6))
    return replace(found, carried_by=carried_by, tapes=tapes)


def test_steps_are_numbered_from_one_without_a_gap() -> None:
    steps = assembly_steps(
        structure(members=(member("rail", 800.0),), plates=(plate(),)), (mount("cam0"),)
    )
    assert [int(step.split(".")[0]) for step in steps] == list(range(1, len(steps) + 1))


def test_what_is_not_there_is_not_told() -> None:
    steps = " ".join(assembly_steps(structure(), (mount("cam0"),)))
    for word in ("Cut", "Drill", "Print", "Join"):
        assert word not in steps


def test_members_are_cut_to_their_length_and_named_once() -> None:
    first = assembly_steps(structure(members=(member("rail", 799.6), member("post", 250.4))), ())[0]
    assert first == "1. Cut to length: rail 2020 800 mm; post 2020 250 mm."


def test_every_hole_is_drilled_where_it_lies_and_its_thread_told() -> None:
    holes = (
        Hole("a1", 12.34, 56.78, 5.5),
        Hole("a2", 0.0, -1.26, 4.2, "tapped", "M5"),
    )
    step = assembly_steps(structure(plates=(plate(*holes),)), ())[0]
    assert step == (
        "1. Drill board (aluminium, 8 mm): a1 at 12.3, 56.8 mm, through 5.5 mm; "
        "a2 at 0.0, -1.3 mm, tapped 4.2 mm M5."
    )


def test_joints_of_the_frame_come_before_the_first_camera_and_each_joint_once() -> None:
    joints = (
        Joint("j1", "rail", "post", ORIGIN, 120.4, None, {"corner-2020": 2}),
        Joint("j2", "post", "cam0 arm", ORIGIN, 30.0, 12.34),
        Joint("j3", "cam0 arm", "cam0", ORIGIN),
        Joint("j4", "post", "cam1 arm", ORIGIN, 60.0),
    )
    mounts = (mount("cam0", "post", "cam0 arm"), mount("cam1", "post", "cam1 arm"))
    steps = assembly_steps(structure(joints=joints), mounts)
    joined = [k for k, s in enumerate(steps) if "Join post to rail" in s]
    hung = [k for k, s in enumerate(steps) if "Hang" in s]
    level = [k for k, s in enumerate(steps) if "datum, and check" in s]
    assert joined < level < hung
    assert len(hung) == 2
    text = " ".join(steps)
    assert len(re.findall("[jJ]oin ", text)) == len(joints)
    assert "Join post to rail, the middle 120 mm from its start with 2 x corner-2020." in text
    assert (
        "join cam0 arm to post, the middle 30 mm from its start, at 12.3 degrees" in steps[hung[0]]
    )
    assert "join cam0 to cam0 arm" in steps[hung[0]]
    assert "cam1" not in steps[hung[0]] and "cam0" not in steps[hung[1]]


def test_a_name_that_begins_like_another_camera_s_is_not_its_part() -> None:
    joints = (Joint("j1", "post", "cam10 arm", ORIGIN), Joint("j2", "post", "cam1 arm", ORIGIN))
    mounts = (mount("cam1", "cam1 arm"), mount("cam10", "cam10 arm"))
    hung = [s for s in assembly_steps(structure(joints=joints), mounts) if "Hang" in s]
    assert "cam10 arm" not in hung[0] and "cam1 arm" in hung[0]
    assert "cam10 arm" in hung[1] and "cam1 arm" not in hung[1].replace("cam10 arm", "")


def test_a_camera_is_on_its_wedge_before_the_wedge_is_on_its_post() -> None:
    joints = (
        Joint("j2", "cam0 post", "cam0 wedge", ORIGIN, 210.0, None, {"cap-screw-m5": 2}),
        Joint("j3", "cam0 wedge", "cam0", ORIGIN, None, None, {"stud-1-4-20": 1}),
        Joint("j1", "board", "cam0 post", ORIGIN),
    )
    held = (mount("cam0", "cam0 post", "cam0 wedge", made=True),)
    steps = assembly_steps(structure(joints=joints, wedges=(wedge("cam0"),)), held)
    assert "Print the wedges: cam0 wedge." in steps[0]
    hang = next(s for s in steps if "Hang" in s)
    order = [
        hang.index("join cam0 post to board"),
        hang.index("screw cam0 onto cam0 wedge from below"),
        hang.index("screw cam0 wedge onto cam0 post with its camera on it, the middle 210 mm"),
        hang.index("plug in the cable last"),
    ]
    assert order == sorted(order)
    assert "pocket with 1 x stud-1-4-20, 12 mm long" in hang
    # 6 mm of the wedge under the head, and four fifths of 5 mm in the nut.
    assert "above with 2 x cap-screw-m5, 10 mm long" in hang


@pytest.mark.parametrize("made", [True, False])
def test_what_is_made_to_the_figure_is_checked_and_the_rest_set(made: bool) -> None:
    text = " ".join(assembly_steps(structure(), (mount("cam0", made=made),)))
    assert ("Set cam0: " in text) != made
    assert ("Nothing is set on cam0; check its figures as drilled and printed: " in text) == made
    # Whole steps are told without a decimal, finer ones and made figures with one.
    assert ("x 12.0 mm" if made else "x 12 mm") in text
    assert "pan 1.5 degrees (from the origin)" in text


def test_tapes_and_focus_are_told_to_the_millimetre() -> None:
    last = assembly_steps(structure(), (mount("cam0"),))[-1]
    assert "datum to cam0 lens 912 mm; floor to cam0 thread 1501 mm. Focus at 900 mm." in last


@pytest.mark.parametrize(
    ("point_mm", "words"),
    [
        ((300.0, 0.0, 10.0), "upper side"),
        ((300.0, 0.0, -40.0), "lower side"),
        ((300.0, -10.0, 1.0), "side away from the subject"),
        ((300.0, 15.0, 0.0), "side towards the subject"),
        ((800.0, 0.0, 0.0), ""),
    ],
)
def test_a_joint_says_on_which_side_of_its_member_it_is(
    point_mm: tuple[float, float, float], words: str
) -> None:
    rail = member("rail", 800.0)
    assert rail.side_of(np.array(point_mm)) == words
    joint = Joint("j1", "rail", "cam0 plate", np.array(point_mm), 300.0)
    steps = assembly_steps(
        structure(members=(rail,), joints=(joint,)), (mount("cam0", "cam0 plate"),)
    )
    said = f", on its {words}, the middle 300 mm from its end" if words else ", the middle 300 mm"
    assert f"to rail{said}" in " ".join(steps)


@pytest.mark.parametrize(
    ("along", "off_mm", "words"),
    [
        (1, (0.0, 0.0, 20.0), "upper side"),
        (1, (0.0, 0.0, -20.0), "lower side"),
        (2, (0.0, 20.0, 0.0), "side towards the subject"),
        (2, (0.0, -20.0, 0.0), "side away from the subject"),
    ],
)
def test_a_member_across_another_says_on_which_side_it_lies(
    along: int, off_mm: tuple[float, float, float], words: str
) -> None:
    """An arm under its stub read as one over it, where the joint is marked on the stub's middle."""
    middle = np.array([300.0, 0.0, 0.0])
    ends = middle + np.array(off_mm) + np.array([[-150.0], [90.0]]) * np.eye(3)[along]
    arm = Member("cam0 arm", "2020", "arm", ends, np.array([1.0, 0.0, 0.0]), (20.0, 20.0))
    rail, joint = member("rail", 800.0), Joint("j1", "rail", "cam0 arm", middle, 300.0)
    assert joint_side(joint, {"rail": rail, "cam0 arm": arm}) == words
    made = structure(members=(rail, arm), joints=(joint,))
    steps = assembly_steps(made, (mount("cam0", "cam0 arm"),))
    assert f"join cam0 arm to rail, on its {words}, the middle 300 mm" in " ".join(steps)


def test_a_member_in_line_with_another_has_no_side() -> None:
    rail, ends = member("rail", 800.0), np.array([[800.0, 0.0, 0.0], [900.0, 0.0, 0.0]])
    on = Member("more", "2020", "rail", ends, np.array([0.0, 1.0, 0.0]), (20.0, 20.0))
    joint = Joint("j1", "rail", "more", np.array([800.0, 0.0, 0.0]), 800.0)
    assert joint_side(joint, {"rail": rail, "more": on}) == ""
