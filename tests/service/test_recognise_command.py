"""``rigwright recognise`` as a user gives it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from recognition_faces import fields, front, small_gallery
from service_helpers import files_under, rigwright_here

from common.errors import ConflictError
from evaluation.recognition.galleryfile import read_gallery, write_gallery
from service.cli.commands.recognise import _new_gallery


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model, and a generated face as points."""
    made = tmp_path_factory.mktemp("recognise")
    write_gallery(made / "model.npz", small_gallery())
    points, _ = front()
    lines = [f"{x:.4f} {y:.4f} {z:.4f} 0 -1 0" for x, y, z in points]
    (made / "anna.xyz").write_text("\n".join(lines), encoding="utf-8")
    return made


@pytest.mark.slow
def test_a_person_is_enrolled_and_verified(folder: Path, tmp_path: Path) -> None:
    for name in ("model.npz", "anna.xyz"):
        shutil.copy(folder / name, tmp_path)
    more = ("--name", "anna", "anna.xyz")
    first = rigwright_here(
        "recognise", "enrol", "lab.npz", "--model", "model.npz", *more, cwd=tmp_path
    )
    assert first.returncode == 0, first.stderr
    assert "anna: 1 captures; 100 % of the face was measured, 30 regions" in first.stdout
    assert list(read_gallery(tmp_path / "lab.npz").persons) == ["anna"]
    done = rigwright_here("recognise", "verify", "lab.npz", *more, "--json", cwd=tmp_path)
    result = json.loads(done.stdout)["result"]
    # The very same points as at enrolment: every region is at distance zero.
    assert done.returncode == (0 if result["same"] else 4)
    assert result["regions"] == 30
    assert result["rates"]["impostors"] > 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["train", "--out", "m.npz"], "either a folder of heads or --population"),
        (["train", ".", "--population", "generator:5", "--out", "m.npz"], "not both"),
        (["train", "--population", "generator:no", "--out", "m.npz"], "is no population"),
        (["train", "none", "--out", "m.npz"], "there is no folder none"),
        (["train", "empty", "--out", "m.npz"], "holds no heads"),
        (["train", "unnamed", "--out", "m.npz"], "does not say whose head it is"),
        (["train", "--population", "generator:12", "--out", "model.npz"], "is there already"),
        (["train", "empty", "--out", "none/m.npz"], "holds no heads"),
        (["enrol", "lab.npz", "--name", "a", "anna.xyz"], "give --model to begin one"),
        (
            ["enrol", "model.npz", "--model", "model.npz", "--name", "a", "anna.xyz"],
            "has its own model",
        ),
        (["enrol", "anna.xyz", "--name", "a", "anna.xyz"], "is no gallery, or is damaged"),
        (["enrol", "model.npz", "--name", "../a", "anna.xyz"], "name"),
        (["enrol", "model.npz", "--name", "a", "none.ply"], "there is no file none.ply"),
        (["verify", "model.npz", "--name", "anna", "anna.xyz"], "anna is not in the gallery"),
        (["verify", "none.npz", "--name", "anna", "anna.xyz"], "there is no file none.npz"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(
    folder: Path, tmp_path: Path, arguments: list[str], words: str
) -> None:
    for name in ("model.npz", "anna.xyz"):
        shutil.copy(folder / name, tmp_path)
    (tmp_path / "empty").mkdir()
    (tmp_path / "unnamed").mkdir()
    (tmp_path / "unnamed" / "head.ply").write_text("ply")
    before = files_under(tmp_path)
    done = rigwright_here("recognise", *arguments, cwd=tmp_path)
    assert done.returncode in (2, 3), done.stderr
    told = [line for line in done.stderr.splitlines() if line.startswith("rigwright: ")]
    assert len(told) == 1
    assert words in told[0]
    assert "; " in told[0]
    assert files_under(tmp_path) == before


def test_training_does_not_replace_those_who_were_enrolled(folder: Path, tmp_path: Path) -> None:
    images, _ = fields(2, 1, 0.1, seed=7)
    place = tmp_path / "lab.npz"
    filled = small_gallery().enrolled("anna", images[0]).enrolled("Bea 2", images[1])
    write_gallery(place, filled)
    train = ("recognise", "train", "--population", "generator:12", "--out", "lab.npz", "--force")
    done = rigwright_here(*train, cwd=tmp_path)
    assert done.returncode == 2
    assert "a gallery in which anna and 1 more would be lost" in done.stderr
    assert list(read_gallery(place).persons) == ["anna", "Bea 2"]
    # Enrolled while a model was being trained, which takes long.
    shutil.copy(folder / "model.npz", place)
    with (
        pytest.raises(ConflictError, match="anna and 1 more would be lost"),
        _new_gallery(place, overwrite=True, enrolled_may_go=False) as made,
    ):
        (made / "gallery.npz").write_bytes((folder / "model.npz").read_bytes())
        write_gallery(place, filled, overwrite=True)
    assert list(read_gallery(place).persons) == ["anna", "Bea 2"]


@pytest.mark.parametrize("command", ["train", "enrol", "verify"])
def test_every_command_shows_an_example(command: str) -> None:
    done = rigwright_here("recognise", command, "--help")
    assert f"Example:  rigwright recognise {command}" in done.stdout


@pytest.mark.slow
def test_generated_persons_are_learnt_and_told(tmp_path: Path) -> None:
    made = rigwright_here(
        "recognise", "train", "--population", "generator:12", "--out", "m.npz", "--json",
        cwd=tmp_path,
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    result = json.loads(made.stdout)["result"]
    assert (result["persons"], result["captures"], result["left_out"]) == (12, 48, [])
    # Generated persons differ by centimetres, their expressions by millimetres.
    assert result["rates"]["equal_error"] < 0.1
    for name, measures in (("anna", {}), ("bea", {"nose_length_mm": 56.0, "chin_mm": 6.0})):
        points, _ = front(**measures)
        lines = [f"{x:.4f} {y:.4f} {z:.4f} 0 -1 0" for x, y, z in points]
        (tmp_path / f"{name}.xyz").write_text("\n".join(lines), encoding="utf-8")
    enrolled = rigwright_here(
        "recognise", "enrol", "g.npz", "--model", "m.npz", "--name", "anna", "anna.xyz",
        cwd=tmp_path,
    )  # fmt: skip
    assert enrolled.returncode == 0, enrolled.stderr
    own = rigwright_here("recognise", "verify", "g.npz", "--name", "anna", "anna.xyz", cwd=tmp_path)
    other = rigwright_here(
        "recognise", "verify", "g.npz", "--name", "anna", "bea.xyz", cwd=tmp_path
    )
    assert (own.returncode, other.returncode) == (0, 4), own.stdout + other.stdout
    assert "the same person" in own.stdout
    assert "not the same person" in other.stdout
