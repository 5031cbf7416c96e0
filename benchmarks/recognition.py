"""Whether the data of a rig suffices to recognise a person: 4 to 9 cameras, three exposures.

    python -m benchmarks.recognition [--model ict_face_model.npz] [--designs FOLDER]
        [--persons 200] [--trained 60] [--probed 200] [--captures 1]
        [--out PAGE]

``--model`` is the compact ICT face model; without it the persons are the bundled generator's.
``--designs`` holds design files with different numbers of cameras, for any head; without it rigs
are designed here, for the bundled one. A few captures are simulated and reconstructed in full: they
set noise and losses of the error model that all other probes are drawn from, and show that it is
right.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.full_captures import FullCapture, full_capture, lights_of
from benchmarks.measured_faces import (
    TIP_MM,
    GeneratedPersons,
    IctPersons,
    Light,
    measured,
    sight_of,
)
from benchmarks.recognition_page import Row, page
from common.errors import InputError
from evaluation.recognition.faces import registered
from evaluation.recognition.recogniser import Recogniser, Template
from evaluation.recognition.training import train
from geometry.arrays import Floats
from geometry.camera import RigCamera
from geometry.head import synthetic_head
from geometry.preparation import prepare_subject
from rig.design.designfile import ReadDesign, read_design
from rig.specification.examples import example_rig
from solver.design import design

COUNTS = (4, 5, 6, 7, 8, 9)
CAPTURES = 4
LIMIT_RATES = (0.01, 0.001)
_START_MM, _START_DEG = 1.5, 3.0
"""How far off the face was found, at most, on heads of tests/geometry."""

Persons = IctPersons | GeneratedPersons


@dataclass(frozen=True, eq=False)
class Probe:
    """One measured face: whose, of which rig and light, at rest or not; None where refused."""

    person: int
    cameras: int
    light: str
    resting: bool
    template: Template | None


def rigs(folder: Path | None) -> dict[int, tuple[RigCamera, ...]]:
    """Rigs by their number of cameras."""
    if folder is not None:
        read = [_about_the_nose(read_design(path)) for path in sorted(folder.glob("*.json"))]
        return {len(cameras): cameras for cameras in read}
    spec = example_rig("face")
    prepared = prepare_subject(synthetic_head(), replace(spec.subject_options, seed=spec.seed))
    return {
        count: design(
            prepared.subject, spec.camera, spec.limits, count=count, seed=spec.seed, starts=1
        ).cameras
        for count in COUNTS
    }


def _about_the_nose(read: ReadDesign) -> tuple[RigCamera, ...]:
    """The cameras, moved so that the foremost point of their subject is where noses will be."""
    points = np.asarray(read.file.points.position_mm)
    way = TIP_MM - points[np.argmin(points[:, 1])]
    return tuple(
        replace(c, pose=replace(c.pose, position_rig_mm=c.pose.position_rig_mm + way))
        for c in read.cameras
    )


def found(points_mm: Floats, tip_mm: Floats, rng: np.random.Generator) -> Floats:
    """The range image of points, begun from about where the face is."""
    turn = _turn(rng)
    start = tip_mm + _START_MM * np.clip(rng.normal(size=3), -2.0, 2.0)
    return registered(points_mm, start, turn).depth_mm


def _turn(rng: np.random.Generator) -> Floats:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(np.radians(_START_DEG * rng.normal(size=3))).as_matrix())


def trained(persons: Persons, count: int) -> Recogniser:
    """From persons that are not probed, scanned without error."""
    images, numbers = [], []
    for person in range(count):
        for capture in range(CAPTURES):
            rng = np.random.default_rng([3, person, capture])
            head = persons.head(10_000 + person, capture).placed(rng)
            try:
                images.append(found(head.samples()[0], head.tip_mm, rng))
                numbers.append(person)
            except InputError as error:
                print(f"left out of the training: {error}", flush=True)
    return train(np.stack(images), np.array(numbers))


def enrolled(persons: Persons, recogniser: Recogniser, count: int) -> dict[int, Template]:
    """From one scan without error, at rest."""
    out = {}
    for person in range(count):
        rng = np.random.default_rng([4, person])
        head = persons.head(person, 0).placed(rng)
        try:
            image = found(head.samples()[0], head.tip_mm, rng)
            out[person] = recogniser.template(image)
        except InputError as error:
            print(f"not enrolled: {error}", flush=True)
    return out


def probes(
    persons: Persons,
    recogniser: Recogniser,
    cameras: Sequence[RigCamera],
    lights: Sequence[Light],
    count: int,
) -> list[Probe]:
    """Every person measured by a rig in every light, half of them with an expression."""
    out = []
    for person in range(count):
        capture = (person + len(cameras)) % 2
        rng = np.random.default_rng([5, person, len(cameras)])
        head = persons.head(person, capture).placed(rng)
        sight = sight_of(head, cameras)
        for number, light in enumerate(lights):
            # Dark and overexposed a third of the persons tell enough.
            if light.lost_share > 0.0 and person % 3:
                continue
            template = None
            try:
                rng = np.random.default_rng([6, person, len(cameras), number])
                image = found(measured(sight, light, rng), head.tip_mm, rng)
                template = recogniser.template(image)
            except InputError:
                pass
            out.append(Probe(person, len(cameras), light.name, capture == 0, template))
    return out


def row_of(
    name: str, light: str, some: Sequence[Probe], gallery: dict[int, Template], model: Recogniser
) -> Row:
    """Rates of some probes against all of the gallery; refused probes match nobody."""
    some = [p for p in some if p.person in gallery]
    known = [p for p in some if p.template is not None]
    names = list(gallery)
    scores = model.scores(
        [gallery[n] for n in names], [p.template for p in known if p.template is not None]
    )
    owner = np.array([p.person for p in known])
    same = np.array(names)[:, None] == owner[None]
    persons = np.broadcast_to(owner[None], same.shape)
    genuine, impostor = scores[same], scores[~same]
    return Row.of(
        name,
        light,
        len(some),
        len(some) - len(known),
        np.nan_to_num(genuine, nan=-1.0),
        np.nan_to_num(impostor, nan=-1.0),
        persons[same],
        persons[~same],
        model.rates.threshold,
    )


def main() -> None:
    """Train, enrol, measure, compare, write."""
    chosen = _arguments()
    begin = time.process_time()
    persons: Persons = IctPersons(chosen.model) if chosen.model else GeneratedPersons()
    placed = rigs(chosen.designs)
    model = trained(persons, chosen.trained)
    print(f"trained: {model.rates}", flush=True)
    gallery = enrolled(persons, model, chosen.persons)
    captures: list[FullCapture] = []
    middle = placed[min(placed, key=lambda n: abs(n - 7))]
    for person in range(chosen.captures):
        for name in ("right", "dark", "over"):
            captures.append(full_capture(persons.head(person, 0), middle, name, person))
            print(captures[-1].line, flush=True)
    lights = lights_of(captures)
    rows = []
    everything: list[Probe] = []
    for count, cameras in placed.items():
        some = probes(persons, model, cameras, lights, chosen.probed)
        everything += some
        for light in lights:
            part = [p for p in some if p.light == light.name]
            rows.append(row_of(f"{count}", light.name, part, gallery, model))
            print(rows[-1].line, flush=True)
    for resting, name in ((True, "at rest, all rigs"), (False, "expression, all rigs")):
        for light in lights:
            part = [p for p in everything if p.resting == resting and p.light == light.name]
            rows.append(row_of(name, light.name, part, gallery, model))
            print(rows[-1].line, flush=True)
    checks = []
    for capture in captures:
        template = capture.template(model)
        score = np.nan
        if template is not None and capture.person in gallery:
            score = float(model.scores([gallery[capture.person]], [template])[0, 0])
        checks.append((capture, score))
    seconds = time.process_time() - begin
    sizes = (len(gallery), chosen.persons)
    text = page(rows, checks, lights, model, *sizes, _command(chosen), seconds)
    print(text)
    if chosen.out:
        chosen.out.write_text(text, encoding="utf-8")


def _command(chosen: argparse.Namespace) -> str:
    """How the page was made, without the places of files."""
    sizes = ("persons", "trained", "probed", "captures")
    more = " ".join(f"--{name} {getattr(chosen, name)}" for name in sizes)
    model = " --model MODEL" if chosen.model else ""
    designs = " --designs FOLDER" if chosen.designs else ""
    return f"python -m benchmarks.recognition{model}{designs} {more} --out PAGE"


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--model", type=Path, help="the compact ICT face model")
    parser.add_argument("--designs", type=Path, help="folder of design files")
    parser.add_argument("--persons", type=int, default=200)
    parser.add_argument("--trained", type=int, default=60, help="others that the model learns from")
    parser.add_argument("--probed", type=int, default=200, help="so many of them are measured")
    parser.add_argument("--captures", type=int, default=1, help="persons photographed in full")
    parser.add_argument("--out", type=Path, help="write the page to this file")
    return parser.parse_args()


if __name__ == "__main__":
    main()
