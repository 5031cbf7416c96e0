"""Whom a recogniser is trained on: a folder of heads, or persons of the bundled generator."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from common.errors import InputError, NotFoundError
from evaluation.recognition.faces import RangeFace, registered
from geometry.arrays import Floats
from geometry.head import RANGES_MM, HeadShape, head_field, random_head_shape

SUFFIXES = (".glb", ".gltf", ".obj", ".ply", ".stl", ".3mf", ".off", ".xyz")
MOST_FILES = 20_000
MOST_PERSONS = 2_000
CAPTURES = 4
"""Of each generated person: one at rest, the others with an expression."""

EXPRESSIONS_MM: dict[str, dict[str, float]] = {
    "smile": {"mouth_width_mm": 7.0, "lip_mm": -0.6, "face_width_mm": 1.5},
    "pout": {"mouth_width_mm": -6.0, "lip_mm": 1.2},
    "frown": {"brow_mm": 1.5, "eye_depth_mm": 0.8},
}
"""What the measures of a head change by at full strength: the generator moves parts, no skin."""

_STEP_MM = 1.6
_HALF_WIDTH_MM, _BELOW_MM, _ABOVE_MM = 70.0, 75.0, 85.0
_FRONT_MM, _DEEP_MM = 160.0, 20.0
_TRACED = 40
_SHARE_OF_DISTANCE = 0.8
_ON_SURFACE_MM = 0.01


@dataclass(frozen=True)
class HeadFile:
    """A head in a file, and whose it is."""

    person: str
    path: Path


def heads_in(folder: Path) -> tuple[HeadFile, ...]:
    """The heads of a folder: ``PERSON_*.ext``, or ``PERSON/*.ext`` in folders of their own.

    Raises :class:`InputError` in one line for a folder that holds none, or a file whose person
    its name does not tell.
    """
    if not folder.is_dir():
        what = f"{folder} is a file" if folder.exists() else f"there is no folder {folder}"
        raise NotFoundError("population", what, "give a folder of heads")
    own = [_named(path) for path in sorted(folder.iterdir()) if _is_head(path)]
    inner = [
        HeadFile(each.name, path)
        for each in sorted(folder.iterdir())
        if each.is_dir()
        for path in sorted(each.iterdir())
        if _is_head(path)
    ]
    found = (*own, *inner)
    if not found:
        raise InputError(
            "population-empty",
            f"{folder} holds no heads",
            "name them PERSON_anything.ply, or give each person a folder",
        )
    if len(found) > MOST_FILES:
        problem = f"{folder} holds {len(found):,} heads; {MOST_FILES:,} are the most"
        raise InputError("population-large", problem, "give fewer")
    return found


def _is_head(path: Path) -> bool:
    return path.is_file() and path.suffix.lower() in SUFFIXES and not path.name.startswith(".")


def _named(path: Path) -> HeadFile:
    person, mark, _ = path.stem.partition("_")
    if not mark or not person:
        raise InputError(
            "population-name",
            f"{path.name} does not say whose head it is",
            "name it PERSON_anything, or put it into a folder with the person's name",
        )
    return HeadFile(person, path)


def generated_faces(persons: int, seed: int) -> Iterator[tuple[int, RangeFace]]:
    """Faces of the bundled generator, :data:`CAPTURES` of each person, and the person's number.

    Each stands a little turned, as people do. Raises :class:`InputError` for too many persons.
    """
    if not 1 <= persons <= MOST_PERSONS:
        raise InputError(
            "population-count", f"{persons} persons are asked for", f"give 1 to {MOST_PERSONS:,}"
        )
    for person in range(persons):
        base = random_head_shape(int(np.random.default_rng([seed, person]).integers(2**31)))
        for capture in range(CAPTURES):
            rng = np.random.default_rng([seed, person, capture])
            shape = base if capture == 0 else expressive(base, rng)
            points, tip = front_of(shape)
            yield person, registered(points, tip, np.eye(3))


def expressive(shape: HeadShape, rng: np.random.Generator) -> HeadShape:
    """The same head with a random mixture of :data:`EXPRESSIONS_MM`."""
    values = {name: getattr(shape, name) for each in EXPRESSIONS_MM.values() for name in each}
    for changes in EXPRESSIONS_MM.values():
        strength = rng.uniform(0.0, 1.0)
        for name, change in changes.items():
            low, high = RANGES_MM[name]
            values[name] = float(np.clip(values[name] + strength * change, low, high))
    return replace(shape, **values)


def front_of(shape: HeadShape) -> tuple[Floats, Floats]:
    """Points (n, 3) of a generated head as seen from the front, and its nose tip (3,).

    Rays along Y are followed through the head's distance field until they meet it.
    """
    field = head_field(shape)
    across = np.arange(-_HALF_WIDTH_MM, _HALF_WIDTH_MM + 0.1, _STEP_MM)
    coarse = np.arange(-120.0, 20.0, 2.0)
    middle = _traced(field, np.stack([np.zeros_like(coarse), coarse], axis=1))
    tip = middle[np.argmin(middle[:, 1])]
    up = tip[2] + np.arange(-_BELOW_MM, _ABOVE_MM, _STEP_MM)
    x, z = (g.ravel() for g in np.meshgrid(across, up))
    return _traced(field, np.stack([x, z], axis=1)), np.asarray(tip)


def _traced(field: Callable[[Floats], Floats], places_mm: Floats) -> Floats:
    """Where rays along Y at places (n, 2), x and z, meet the surface, (m, 3)."""
    points = np.stack(
        [places_mm[:, 0], np.full(len(places_mm), -_FRONT_MM), places_mm[:, 1]], axis=1
    )
    open_ = np.arange(len(points))
    for _ in range(_TRACED):
        distance = field(points[open_])
        points[open_, 1] += _SHARE_OF_DISTANCE * distance
        open_ = open_[(np.abs(distance) > _ON_SURFACE_MM) & (points[open_, 1] < _DEEP_MM)]
        if not len(open_):
            break
    met = points[:, 1] < _DEEP_MM
    met[open_] = False
    return points[met]
