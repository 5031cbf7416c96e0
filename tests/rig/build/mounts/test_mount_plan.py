"""A T-slot frame from end to end, and its file."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from rigs import face, face_cameras, face_limits

from common.errors import CancelledError, InputError
from common.progress import Progress
from rig.build.mounts.making import make_plan
from rig.build.mounts.plan import MountPlan
from rig.build.mounts.planfile import plan_document, plan_from_mapping, read_plan
from rig.build.mounts.systemfile import parse_system
from solver.quality import evaluate


@cache
def plan() -> MountPlan:
    subject, limits = face(), face_limits()
    cameras = face_cameras(subject, 4)
    return make_plan(cameras, subject, limits, parse_system('kind = "t-slot"'), trials=3)


@pytest.mark.slow
def test_every_setting_exists_and_gives_the_pose() -> None:
    for mount in plan().mounts:
        assert all(setting.exists for setting in mount.settings)
        assert np.allclose(mount.pose().position_rig_mm, mount.camera.pose.position_rig_mm)


def test_cameras_stay_within_what_rounding_can_do() -> None:
    for mount in plan().mounts:
        off = mount.camera.pose.position_rig_mm - mount.wanted.position_rig_mm
        # Half a degree at 0.7 to 0.9 m is 8 mm per angle. The start breaks limits by about 5 % of
        # its distance, which the slides mend as well.
        assert np.linalg.norm(off) < 60.0


def test_nothing_collides_and_the_figures_are_those_of_an_evaluation() -> None:
    made = plan()
    assert not made.clashes
    again = evaluate(face(), tuple(m.camera for m in made.mounts), face_limits())
    assert made.price.built.sigma_median_mm == again.sigma_median_mm
    assert made.price.built.feasible == again.feasible


def test_two_tapes_check_each_camera() -> None:
    for mount in plan().mounts:
        assert len(mount.tapes) == 2
        assert all(tape.length_mm > 100.0 for tape in mount.tapes)


def test_steps_name_members_settings_and_tapes() -> None:
    text = "\n".join(plan().steps)
    for mount in plan().mounts:
        assert f"Hang {mount.name}" in text
        assert f"{mount.tapes[0].length_mm:.0f} mm" in text
    for member in plan().structure.members:
        assert f"{member.id} {member.part} {member.length_mm:.0f} mm" in text


def test_a_plan_file_reads_back_to_the_same_plan() -> None:
    document = plan_document(plan())
    back = plan_from_mapping(json.loads(json.dumps(document, allow_nan=False)))
    assert plan_document(back) == document
    assert back.mounts[0].values() == plan().mounts[0].values()


def test_an_unknown_key_in_a_plan_file_is_named() -> None:
    document = plan_document(plan())
    with pytest.raises(InputError, match="stepz is not known"):
        plan_from_mapping(document | {"stepz": []}, "plan.json")


def test_a_plan_file_is_read_from_disk_or_named(tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(plan_document(plan())))
    assert plan_document(read_plan(path)) == plan_document(plan())
    with pytest.raises(InputError, match="cannot read the plan file"):
        read_plan(tmp_path / "none.json")
    path.write_text("{")
    with pytest.raises(InputError, match="not JSON"):
        read_plan(path)


def test_a_pose_that_its_settings_do_not_give_is_refused() -> None:
    document = plan_document(plan())
    document["mounts"][0]["settings"][0]["value"] += 1.0
    with pytest.raises(InputError, match="do not give its pose"):
        plan_from_mapping(document)


def test_a_camera_that_stands_already_is_kept_clear_of_and_not_mounted() -> None:
    subject, limits = face(), face_limits()
    first, *others = face_cameras(subject, 4)
    cameras = (replace(first, fixed=True), *others)
    made = make_plan(cameras, subject, limits, parse_system('kind = "plate"'), trials=0)
    assert [mount.name for mount in made.mounts] == [camera.name for camera in others]
    assert first.name in {solid.owner for solid in made.structure.solids}
    assert not made.clashes


def test_progress_never_falls_and_cancel_stops() -> None:
    subject, limits, seen = face(), face_limits(), []

    class Stop:
        def is_set(self) -> bool:
            return len(seen) > 3

    def note(progress: Progress) -> None:
        seen.append(progress.fraction)

    with pytest.raises(CancelledError):
        make_plan(
            face_cameras(subject, 4), subject, limits, parse_system('kind = "t-slot"'),
            progress=note, cancel=Stop(),
        )  # fmt: skip
    assert seen == sorted(seen)
    assert len(seen) > 3
