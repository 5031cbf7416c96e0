"""Whether faces are found in scans of heads in any pose, crop, form and unit.

    python -m benchmarks.heads ict_face_model.npz [--heads 500] [--first 0] [--verbose]

Every other head is a person of the ICT FaceKit model with an expression, the others come from the
bundled generator, of which 40 are made; none of them are those that the template was made from.
A quarter stand as a file of another program would, the others at random. A file that is refused
is a miss that was told; one that is read with its nose tip more than 5 mm or its axes more than 3
degrees from the truth is a silent one. Processor time is that of reading the file, which finds
the face.
"""

from __future__ import annotations

import argparse
import logging
import os
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

os.environ.update(
    dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
)

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from benchmarks.face_template import model_of, person
from benchmarks.pages import table
from common.errors import InputError
from geometry.arrays import Floats, Ints
from geometry.head import random_head_shape, synthetic_head
from geometry.locating.finding import angle_deg
from geometry.reading import read_scan
from geometry.units import MM_PER_UNIT

TIP_MM, TURN_DEG, SECONDS = 5.0, 3.0, 2.0
GENERATED, FIRST_SEED = 40, 5000
CROPS = ("face", "head", "bust")
LOG = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Trial:
    """A file's mesh or cloud with its truth.

    ``vertices`` (n, 3) and ``tip`` (3,) in units of the file, ``faces`` (m, 3), none of a cloud;
    ``rotation_file_to_rig`` (3, 3).
    """

    kind: str
    crop: str
    unit: str
    vertices: Floats
    faces: Ints
    tip: Floats
    rotation_file_to_rig: Floats

    @property
    def form(self) -> str:
        """Mesh or cloud."""
        return "mesh" if len(self.faces) else "cloud"


@dataclass(frozen=True)
class Outcome:
    """What became of a trial; distances are NaN where the file was refused."""

    trial: Trial
    tip_mm: float
    turn_deg: float
    seconds: float
    refusal: str = ""

    @property
    def silent(self) -> bool:
        """Read, and the face is not where it was found."""
        return not self.refusal and not (self.tip_mm <= TIP_MM and self.turn_deg <= TURN_DEG)


@lru_cache(maxsize=GENERATED)
def generated(number: int, shoulders: bool) -> tuple[Floats, Ints, Floats]:
    """Vertices, faces and nose tip of a head of the generator, rig frame, mm."""
    rng = np.random.default_rng([15, number])
    shape = replace(
        random_head_shape(FIRST_SEED + number),
        hair_mm=float(rng.choice([0.0, 5.0, 15.0])),
        shoulder_width_mm=float(rng.uniform(350.0, 480.0)) if shoulders else 0.0,
    )
    scan = synthetic_head(shape, number)
    vertices = np.asarray(scan.vertices_mm)
    middle = np.flatnonzero((np.abs(vertices[:, 0]) < 3.0) & (vertices[:, 2] > -75.0))
    tip = vertices[middle[vertices[middle, 1].argmin()]]
    return vertices, np.asarray(scan.faces), np.array([0.0, tip[1], tip[2]])


def drawn(number: int, model: dict[str, Floats]) -> Trial:
    """A head by its number."""
    rng = np.random.default_rng([14, number])
    if number % 2:
        # A person's nose is where the average's foremost vertex went.
        nose = int(model["neutral"][:, 2].argmax())
        vertices, faces = person(model, rng), model["triangles"].astype(np.int64)
        tip, crop = vertices[nose], str(rng.choice(CROPS[:2]))
    else:
        crop = str(rng.choice(CROPS))
        one = int(rng.integers(GENERATED))
        vertices, faces, tip = generated(one, crop == "bust" or one % 4 == 0)
    if crop == "face":
        near = np.linalg.norm(vertices - tip, axis=1) <= rng.uniform(85.0, 120.0)
        faces = faces[near[faces].all(axis=1)]
    elif crop == "head":
        above = vertices[:, 2] > tip[2] - rng.uniform(85.0, 110.0)
        faces = faces[above[faces].all(axis=1)]
    if rng.random() < 0.5:
        vertices, faces = cloud(vertices, faces, rng)
    else:
        used, faces = np.unique(faces, return_inverse=True)
        vertices, faces = vertices[used], faces.reshape(-1, 3)
    turn = np.asarray(Rotation.random(random_state=rng).as_matrix())
    if rng.random() < 0.25:
        turn = np.asarray(Rotation.create_group("O").as_matrix()[rng.integers(24)])
    unit = str(rng.choice(list(MM_PER_UNIT)))
    shift = rng.uniform(-400.0, 400.0, 3)
    size = MM_PER_UNIT[unit]
    return Trial(
        "person" if number % 2 else "generator",
        *(crop, unit, (vertices @ turn.T + shift) / size, faces, (turn @ tip + shift) / size),
        turn.T,
    )


def cloud(vertices: Floats, faces: Ints, rng: np.random.Generator) -> tuple[Floats, Ints]:
    """Points of a surface about as far apart as scanners give them, with their noise."""
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    count = int(mesh.area / rng.uniform(2.0, 3.5) ** 2)
    points, _ = trimesh.sample.sample_surface(mesh, count, seed=int(rng.integers(1 << 30)))
    noise = rng.normal(0.0, rng.uniform(0.05, 0.4), np.shape(points))
    return np.asarray(points) + noise, np.zeros((0, 3), dtype=np.int64)


def tried(trial: Trial, folder: Path) -> Outcome:
    """Write a file, read it, compare."""
    if len(trial.faces):
        path = folder / "head.ply"
        trimesh.Trimesh(trial.vertices, trial.faces, process=False).export(path)
    else:
        path = folder / "head.xyz"
        np.savetxt(path, trial.vertices, fmt="%.7g")
    began = time.process_time()
    try:
        scan = read_scan(path)
    except InputError as error:
        return Outcome(trial, np.nan, np.nan, time.process_time() - began, str(error))
    seconds = time.process_time() - began
    if scan.face is None:
        return Outcome(trial, np.nan, np.nan, seconds, "no face")
    turn = scan.rig_from_file[:3, :3]
    back = np.linalg.inv(turn)
    found = back @ (scan.face.nose_tip_mm - scan.rig_from_file[:3, 3])
    straight = turn / np.cbrt(np.linalg.det(turn))
    return Outcome(
        trial,
        float(np.linalg.norm(found - trial.tip) * MM_PER_UNIT[trial.unit]),
        angle_deg(straight, trial.rotation_file_to_rig),
        seconds,
    )


def row(words: str, outcomes: Sequence[Outcome]) -> tuple[str, ...]:
    """A line of the table."""
    found = [one for one in outcomes if not one.refusal]
    tips, turns = [one.tip_mm for one in found], [one.turn_deg for one in found]
    refused, silent = len(outcomes) - len(found), sum(one.silent for one in found)
    return (
        words,
        *(str(len(outcomes)), str(len(found) - silent), str(refused), str(silent)),
        f"{np.median(tips):.1f}, {np.max(tips):.1f} mm" if found else "",
        f"{np.median(turns):.1f}, {np.max(turns):.1f}" if found else "",
        f"{np.median([o.seconds for o in outcomes]):.1f}, {max(o.seconds for o in outcomes):.1f}",
    )


def page(outcomes: Sequence[Outcome]) -> str:
    """The table: all, then by what differs."""
    head = (
        *("heads", "trials", "found", "refused", "silently wrong"),
        *("nose tip off: median, most", "degrees off", "processor s"),
    )
    rows = [row("all", outcomes)]
    for name in ("kind", "crop", "form", "unit"):
        values = sorted({getattr(one.trial, name) for one in outcomes})
        rows += [
            row(value, [one for one in outcomes if getattr(one.trial, name) == value])
            for value in values
        ]
    return table(head, rows)


def main() -> None:
    """Try all, print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("model", type=Path, help="ict_face_model.npz")
    parser.add_argument("--heads", type=int, default=500)
    parser.add_argument("--first", type=int, default=0, help="number of the first head")
    parser.add_argument("--verbose", action="store_true", help="each head")
    asked = parser.parse_args()
    logging.basicConfig(
        level=logging.INFO if asked.verbose else logging.WARNING, format="%(message)s"
    )
    model, outcomes = model_of(asked.model), []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(asked.first, asked.first + asked.heads):
            one = tried(drawn(number, model), Path(folder))
            outcomes.append(one)
            LOG.info(
                *("%d %s %s %s %s: %.2f mm, %.2f deg, %.1f s %s%s", number),
                *(one.trial.kind, one.trial.crop, one.trial.form, one.trial.unit),
                *(one.tip_mm, one.turn_deg, one.seconds, one.refusal),
                " SILENT" if one.silent else "",
            )
    print(page(outcomes))


if __name__ == "__main__":
    main()
