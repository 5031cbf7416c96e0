"""Plan files: a :class:`rig.build.mounts.plan.MountPlan` as JSON, and back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from common.files.reading import read_json
from common.files.strict import validated
from common.version import program_version
from geometry.frames import Pose
from geometry.rotations import nearest_rotation
from rig.build.mounts.plan import MountPlan
from rig.build.mounts.planmodel import (
    SCHEMA,
    ClashModel,
    LinkModel,
    MountModel,
    PlanFile,
    PriceModel,
    SagModel,
    SettingModel,
    StanceModel,
    TapeModel,
    ToleranceModel,
    WantedModel,
)
from rig.build.mounts.settings import CameraMount
from rig.build.mounts.structuremodel import StructureModel
from rig.design.designfile import design_from_mapping, placed_camera

LARGEST_FILE_BYTES = 200_000_000


def plan_document(plan: MountPlan) -> dict[str, Any]:
    """The whole plan as JSON data, without NaN or infinity."""
    file = PlanFile(
        schema=SCHEMA,
        rigwright=program_version(),
        name=plan.name,
        system=plan.system,
        datum_rig_mm=[float(v) for v in plan.datum_rig_mm],
        mounts=[_mount_model(mount) for mount in plan.mounts],
        structure=StructureModel.of(plan.structure),
        price=PriceModel.of(plan.price),
        tolerances=[ToleranceModel.of(t) for t in plan.tolerances],
        clashes=[ClashModel.model_validate(vars(c)) for c in plan.clashes],
        yield_share=plan.yield_share if np.isfinite(plan.yield_share) else None,
        yield_trials=plan.yield_trials,
        steps=list(plan.steps),
        notes=list(plan.notes),
        sags=[SagModel.of(sag) for sag in plan.sags],
        stances=[StanceModel.of(stance) for stance in plan.stances],
    )
    return file.model_dump(by_alias=True)


def _mount_model(mount: CameraMount) -> MountModel:
    wanted = WantedModel(
        position_mm=mount.wanted.position_rig_mm.tolist(),
        rotation_rig_to_camera=mount.wanted.rotation_rig_to_camera.tolist(),
    )
    return MountModel.model_validate(
        {
            "camera": placed_camera(mount.camera),
            "wanted": wanted,
            "settings": [SettingModel.of(s) for s in mount.settings],
            "chain": [LinkModel.of(link) for link in mount.chain],
            "carried_by": list(mount.carried_by),
            "tapes": [TapeModel.model_validate(vars(t)) for t in mount.tapes],
        }
    )


def read_plan(path: Path) -> MountPlan:
    """The plan of a file; raises a one-line :class:`InputError`."""
    data = read_json(path, "plan", "plan file", LARGEST_FILE_BYTES)
    return plan_from_mapping(data, path.name)


def plan_from_mapping(data: object, name: str = "plan") -> MountPlan:
    """The same from parsed JSON; ``name`` stands in front of every error."""
    file = validated(PlanFile, data, name)
    share = float("nan") if file.yield_share is None else file.yield_share
    return MountPlan(
        name=file.name,
        system=file.system,
        datum_rig_mm=np.array(file.datum_rig_mm),
        structure=file.structure.made(),
        mounts=_mounts(file, name),
        price=file.price.made(),
        tolerances=tuple(t.made() for t in file.tolerances),
        clashes=tuple(c.made() for c in file.clashes),
        yield_share=share,
        yield_trials=file.yield_trials,
        steps=tuple(file.steps),
        notes=tuple(file.notes),
        sags=tuple(sag.made() for sag in file.sags),
        stances=tuple(stance.made() for stance in file.stances),
    )


def _mounts(file: PlanFile, name: str) -> tuple[CameraMount, ...]:
    """Cameras are read as a design's are: one reader of lenses, bodies and rotations."""
    design = {
        "schema": "rigwright.design/1",
        "cameras": [m.camera.model_dump() for m in file.mounts],
    }
    cameras = design_from_mapping(design, name).cameras
    return tuple(
        CameraMount(
            camera,
            Pose(
                np.array(model.wanted.position_mm),
                nearest_rotation(np.array(model.wanted.rotation_rig_to_camera)),
            ),
            tuple(s.made() for s in model.settings),
            tuple(link.made() for link in model.chain),
            tuple(model.carried_by),
            tuple(t.made() for t in model.tapes),
        )
        for camera, model in zip(cameras, file.mounts, strict=True)
    )
