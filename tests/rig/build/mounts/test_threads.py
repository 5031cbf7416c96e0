"""Studs that go into holes, adapters where they do not, heads that carry their cameras."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from rigs import compact_camera, face, face_cameras, face_limits

from common.errors import InputError
from rig.build.mounts.making import make_plan
from rig.build.mounts.surroundings import Surroundings
from rig.build.mounts.systemfile import system_from_mapping
from rig.build.mounts.systems.base import Built
from rig.build.mounts.systems.threads import adapter_for
from rig.catalogue import load_catalogue

CATALOGUE = load_catalogue()
AROUND = Surroundings(face(), face_limits(), (), -1350.0, 2.0)


def built(kind: str, head: str, model: str = "compact") -> Built:
    """Two cameras on a mount, of a kind that the catalogue may know."""
    kind_of = compact_camera(name=model)
    cameras = tuple(replace(c, camera=kind_of) for c in face_cameras(face(), 2))
    return system_from_mapping({"kind": kind, "head": head}).system.hold(cameras, AROUND).build()


def counts(made: Built) -> Counter[str]:
    found = Counter(part.part for part in made.structure.parts)
    for joint in made.structure.joints:
        found.update(joint.fasteners)
    return found


@pytest.mark.parametrize("kind", ["t-slot", "arc"])
@pytest.mark.parametrize("head", ["generic-ball-25", "manfrotto-410"])
def test_the_plate_under_a_head_has_its_stud(kind: str, head: str) -> None:
    """A 1/4-20 ball head used to be put on a 3/8-16 stud."""
    made = built(kind, head)
    plates = [p for p in made.structure.parts if p.role == "head plate"]
    wanted = CATALOGUE.heads[head].base_thread
    assert {CATALOGUE.brackets[p.part].thread for p in plates} == {wanted}
    assert not [part for part in counts(made) if "adapter" in part]


def test_a_head_on_a_stud_of_another_thread_gets_an_adapter_and_stands_higher() -> None:
    made = built("tripods", "generic-ball-25")
    assert counts(made)["adapter-3-8-1-4"] == 2
    for mount in made.mounts:
        head = next(p for p in made.structure.parts if p.id == f"{mount.name} head")
        foot = np.array([0.0, 0.0, AROUND.floor_z_mm + mount.values()["column"] + 10.0])
        if np.allclose(head.rig_from_part[:3, 2], [0, 0, 1]):
            assert head.rig_from_part[2, 3] == pytest.approx(foot[2])
    assert not counts(built("tripods", "manfrotto-410"))["adapter-3-8-1-4"]


def test_a_camera_with_a_larger_thread_gets_a_bushing() -> None:
    body = replace(CATALOGUE.cameras["canon-eos-250d"], tripod_thread="3/8-16")
    own = replace(CATALOGUE, cameras={**CATALOGUE.cameras, body.id: body})
    camera = compact_camera(name=f"{body.id} {next(iter(own.lenses))}")
    cameras = tuple(replace(c, camera=camera) for c in face_cameras(face(), 2))
    system = system_from_mapping({"kind": "t-slot"}, catalogue=own).system
    assert counts(system.hold(cameras, AROUND).build())["bushing-1-4-3-8"] == 2


def test_threads_that_nothing_joins_are_told() -> None:
    assert adapter_for("1/4-20", "1/4-20", "head x", CATALOGUE) is None
    assert adapter_for(None, "1/4-20", "head x", CATALOGUE) is None
    with pytest.raises(InputError, match="stud M6 does not go into the hole 1/4-20 of head x"):
        adapter_for("M6", "1/4-20", "head x", CATALOGUE)


@pytest.mark.parametrize("kind", ["t-slot", "arc", "tripods"])
def test_a_camera_that_is_too_heavy_for_its_head_is_refused_with_heads_that_carry_it(
    kind: str,
) -> None:
    spec = system_from_mapping({"kind": kind, "camera_kg": 4.5})
    with pytest.raises(InputError) as raised:
        make_plan(face_cameras(face(), 2), face(), face_limits(), spec, trials=0)
    said = str(raised.value)
    assert "head generic-ball-25 carries 2 kg" in said and "4.5 kg" in said
    assert "manfrotto-410" in said and "\n" not in said
