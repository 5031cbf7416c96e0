"""What the importers of other programs ask of a file, beyond its figures."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from exchange_rigs import hand_rig

from geometry.camera import RigCamera
from geometry.exchange import export_files


def rig_of(count: int) -> tuple[RigCamera, ...]:
    return tuple(replace(hand_rig()[0], name=f"cam{k:02d}") for k in range(count))


@pytest.mark.parametrize("distortion", [[0.0] * 5, [0.1, 0, 0, 0, 0], [0.1, 0.01, 1e-3, 2e-3, 0]])
def test_every_xmp_names_the_model_that_importers_take(distortion: list[float]) -> None:
    """AliceVision throws at any model but brown3t2, and wants six terms."""
    one = hand_rig()[0]
    camera = replace(one, camera=replace(one.camera, distortion=np.array(distortion)))
    for text in export_files("realityscan", (camera,)).values():
        assert re.findall(rb'DistortionModel="([^"]*)"', text) == [b"brown3t2"]
        terms = re.findall(rb"<xcr:DistortionCoeficients>(.*?)<", text)[0].split()
        k1, k2, p1, p2, k3 = distortion
        assert [float(t) for t in terms] == [k1, k2, k3, 0.0, p2, p1]


@pytest.mark.parametrize("count", [3, 7, 9, 10, 24])
def test_nerfstudio_has_images_to_evaluate_on(count: int) -> None:
    document = json.loads(export_files("nerfstudio", rig_of(count))["transforms.json"])
    frames = [frame["file_path"] for frame in document["frames"]]
    train, held = document["train_filenames"], document["val_filenames"]
    # As nerfstudio reads it: every name must be a frame's, and no image is used for both.
    assert sorted(train + held) == sorted(frames) and not set(train) & set(held)
    assert document["test_filenames"] == held
    assert len(held) == max(1, count // 10)


@pytest.mark.parametrize("count", [1, 2])
def test_two_images_are_both_trained_on(count: int) -> None:
    document = json.loads(export_files("nerfstudio", rig_of(count))["transforms.json"])
    assert "val_filenames" not in document and "train_filenames" not in document
