"""Study files and their grids: what is refused, and what rig each choice stands for."""

from __future__ import annotations

from pathlib import Path

import pytest

from common.errors import InputError, NotFoundError
from rig.specification.rigfile import RigFile, read_rig_file
from rig.study.grid import choices, rig_of
from rig.study.studyfile import Study, StudyFile, read_study_file

ROOT = Path(__file__).resolve().parents[3]


def face() -> RigFile:
    return read_rig_file(ROOT / "examples/face/rig.toml")


def written(folder: Path, text: str) -> Path:
    path = folder / "study.toml"
    path.write_text(f'schema = "rigwright.study/1"\nrigs = ["rig.toml"]\n{text}', encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[grid]\ncamera = [4]", "did you mean cameras?"),
        ("[grids]\ncameras = [4]", "did you mean grid?"),
        ("[grid]\ncameras = [4, 5, 4]", "cameras holds a value twice"),
        ("[grid]\ncameras = [0]", "grid.cameras[0] is 0"),
        ("[grid]\ndesign_distance_mm = [-200.0]", "grid.design_distance_mm[0] is -200.0"),
        ('[grid]\nform = ["round"]', "'free' or 'symmetric'"),
        ('[grid]\nstrategy = ["guess"]', "grid.strategy[0] is 'guess'"),
        ("[population]\nheads = 0", "population.heads is 0"),
        ("[recommend]\ncamera_worth_share = 1.5", "recommend.camera_worth_share is 1.5"),
        ("[grid", "study.toml is not a study file"),
    ],
)
def test_a_slip_in_a_study_file_is_told_in_one_line(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(InputError) as caught:
        read_study_file(written(tmp_path, text))
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("path", sorted((ROOT / "examples/studies").glob("*.toml")))
def test_the_examples_can_be_read(path: Path) -> None:
    if 'schema = "rigwright.study/1"' not in path.read_text(encoding="utf-8"):
        return
    file = read_study_file(path)
    rigs = [read_rig_file(path.parent / name) for name in file.rigs]
    for choice in choices(file.study(), [rig.name for rig in rigs], ["someone"]):
        rig = next(rig for rig in rigs if rig.name == choice.rig)
        assert rig_of(choice, rig, file.study()).cameras == choice.cameras


def test_every_choice_comes_with_every_other() -> None:
    study = Study.model_validate(
        {"grid": {"cameras": [4, 5], "form": ["free", "symmetric"], "seed": [1, 2, 3]}}
    )
    found = choices(study, ["a", "b"], ["x", "y"])
    assert len(found) == 2 * 2 * 3 * 2 * 2
    assert len({c.model_dump_json() for c in found}) == len(found)
    assert choices(Study(), ["a"], ["x"])[0].words() == ""


def test_a_grid_that_would_never_end_is_refused() -> None:
    study = Study.model_validate({"grid": {"seed": list(range(20_001))}})
    with pytest.raises(InputError, match="20001 designs"):
        choices(study, ["a"], ["x"])


def test_a_lens_that_nobody_makes_is_refused_with_the_nearest() -> None:
    with pytest.raises(NotFoundError, match="fujinon-cf25za-1s"):
        choices(Study.model_validate({"grid": {"lens": ["fujinon-cf25za-1"]}}), ["a"], ["x"])


def test_choices_become_limits_of_the_rig_file() -> None:
    study = Study.model_validate(
        {
            "starts": 2,
            "grid": {
                "cameras": [5], "design_distance_mm": [300.0], "neighbour_base_height": [0.4],
                "form": ["symmetric"], "f_number": [11.0], "strategy": ["exchange"], "seed": [9],
            },
        }
    )  # fmt: skip
    (choice,) = choices(study, ["rig"], ["x"])
    made = rig_of(choice, face(), study)
    assert (made.cameras, made.starts, made.seed, made.strategy) == (5, 2, 9, "exchange")
    limits = made.to_spec().limits
    # The file has 10 mm for 200 mm: 5 %.
    assert limits.spacing is not None
    assert (limits.spacing.edge_mm, limits.spacing.tolerance_mm) == (300.0, 15.0)
    assert limits.symmetry is not None
    assert limits.symmetry.balance_tolerance_mm == 5.0
    assert (limits.base_height.min, limits.base_height.neighbour_max) == (0.15, 0.4)
    assert made.camera.f_number == 11.0
    free = choice.model_copy(update={"form": "free"})
    assert rig_of(free, face(), study).to_spec().limits.symmetry is None


def test_what_no_choice_changes_stays_as_the_rig_file_has_it() -> None:
    (choice,) = choices(Study(), ["rig"], ["x"])
    assert rig_of(choice, face(), Study()) == face()


def test_a_lens_needs_a_camera_of_the_catalogue() -> None:
    study = Study.model_validate({"grid": {"lens": ["fujinon-cf25za-1s"]}})
    (choice,) = choices(study, ["rig"], ["x"])
    with pytest.raises(InputError, match="name it by \\[camera\\] model"):
        rig_of(choice, face(), study)


def test_a_lens_replaces_the_figures_of_the_one_before() -> None:
    data = {"schema": "rigwright.rig/1", "camera": CAMERA}
    rig = RigFile.model_validate(data)
    study = Study.model_validate({"grid": {"lens": ["canon-rf-35-f18-macro"]}})
    (choice,) = choices(study, ["rig"], ["x"])
    made = rig_of(choice, rig, study)
    assert (rig.camera.focal_length_mm, made.camera.focal_length_mm) == (50.0, 35.0)
    assert made.camera.f_number == rig.camera.f_number
    assert made.camera.image_size_px == rig.camera.image_size_px


CAMERA = {"model": "canon-eos-rp", "lens": "canon-rf-50-f18-stm", "f_number": 8.0}


def test_the_file_and_what_is_asked_of_it_have_the_same_keys() -> None:
    assert set(StudyFile.model_fields) - set(Study.model_fields) == {"schema_", "rigs", "heads"}
