"""Makes ``geometry/locating/faces.npz``: what faces look like and how they differ.

Faces are drawn from the ICT FaceKit model (MIT licence, USC Institute for Creative Technologies),
with expressions, and from the bundled generator; the ways in which they differ are the principal
components of how points of the average face move, after shift and size are taken out. Turns are
left in: how a face slopes in its head's own axes is part of its shape.

    python -m benchmarks.face_template ict_face_model.npz
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh

from geometry.arrays import Floats
from geometry.head import head_field, random_head_shape
from geometry.locating.template import RADIUS_MM

_SPACING_MM = 4.5
_MOST_TURN_DEG = 76.0
_STEEP_MM = 85.0
_PEOPLE = 800
_BUNDLED = 60
_MODES = 96
_RIG_FROM_MODEL = 10.0 * np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def model_of(path: Path) -> dict[str, Floats]:
    """The arrays of the model that a face is drawn from."""
    with np.load(path) as kept:
        return {
            name: np.asarray(kept[name])
            for name in ("neutral", "triangles", "identity", "expression")
        }


def average(model: dict[str, Floats]) -> tuple[Floats, Floats, Callable[[Floats], Floats]]:
    """Points (n, 3) and normals of the average face, and what finds them on other people."""
    vertices = model["neutral"] @ _RIG_FROM_MODEL.T
    vertices = vertices - vertices[vertices[:, 1].argmin()]
    mesh = trimesh.Trimesh(vertices, model["triangles"], process=False)
    steps = _SPACING_MM * np.arange(-24, 25)
    x, z = (grid.ravel() for grid in np.meshgrid(steps, steps))
    eyes = np.stack([x, np.full(len(x), -60.0), z], axis=1)
    found, _, face = mesh.ray.intersects_location(
        eyes, np.tile([0.0, 1.0, 0.0], (len(eyes), 1)), multiple_hits=False
    )
    front = -mesh.face_normals[face][:, 1] >= np.cos(np.radians(_MOST_TURN_DEG))
    keep = front & (np.linalg.norm(found, axis=1) <= RADIUS_MM)
    corners = model["triangles"][face[keep]]
    share = trimesh.triangles.points_to_barycentric(vertices[corners], found[keep])

    def at(values: Floats) -> Floats:
        return np.einsum("nk,nkj->nj", share, values[corners])

    normals = at(mesh.vertex_normals)
    return found[keep], normals / np.linalg.norm(normals, axis=1, keepdims=True), at


def person(model: dict[str, Floats], rng: np.random.Generator) -> Floats:
    """Vertices of a person with an expression, the nose tip at the origin."""
    shape = model["neutral"] + np.tensordot(rng.normal(size=60), model["identity"], 1)
    if rng.random() < 0.6:
        strength = rng.random(12) * (rng.random(12) < 0.35)
        shape = shape + np.tensordot(strength, model["expression"], 1)
    vertices = shape @ _RIG_FROM_MODEL.T
    # By its number: on some people lips or chin stand out farther than the nose.
    nose = model["neutral"][:, 2].argmax()
    return np.asarray(vertices - vertices[nose] * [0.0, 1.0, 1.0])


def resized(points: Floats, mean: Floats) -> Floats:
    """Points of a person in the size in which they are nearest to the average's."""
    inner = np.linalg.norm(mean, axis=1) < _STEEP_MM
    return points * (points[inner] * mean[inner]).sum() / (points[inner] ** 2).sum()


def bundled(seed: int, mean: Floats, normals: Floats) -> Floats:
    """How far points of the average face are from a head of the generator, along normals."""
    field = head_field(random_head_shape(seed))
    profile = np.stack([np.zeros(61), np.full(61, -160.0), np.arange(-70.0, -9.0)], axis=1)
    for _ in range(40):
        profile[:, 1] += 0.8 * field(profile)
    tip = profile[profile[:, 1].argmin()]
    tried = []
    for size in (0.95, 1.02, 1.09):
        along = np.zeros(len(mean))
        for _ in range(12):
            along -= 0.8 * field(mean / size + tip + along[:, None] * normals)
            along = np.clip(along, -25.0, 25.0)
        tried.append(size * along)
    best = min(tried, key=lambda off: float((off**2).sum()))
    return np.asarray(best[:, None] * normals)


def main() -> None:
    """Draw, find the components, write."""
    model = model_of(Path(sys.argv[1]))
    rng = np.random.default_rng(0)
    mean, normals, at = average(model)
    people = [resized(at(person(model, rng)), mean) - mean for _ in range(_PEOPLE)]
    heads = [bundled(seed, mean, normals) for seed in range(_BUNDLED)]
    # As if there were twice as many people as heads.
    heads = [np.sqrt(_PEOPLE / (2.0 * _BUNDLED)) * head for head in heads]
    drawn = np.stack(people + heads).reshape(len(people) + len(heads), -1)
    _, size, ways = np.linalg.svd(drawn, full_matrices=False)
    modes = ways[:_MODES] * size[:_MODES, None] / np.sqrt(1.5 * _PEOPLE)
    rest = np.sqrt((size[_MODES:] ** 2).sum() / (1.5 * _PEOPLE * len(mean)))
    sys.stdout.write(f"{len(mean)} points, {_MODES} ways, what is left: {rest:.2f} mm\n")
    np.savez_compressed(
        Path(__file__).parents[1] / "geometry" / "locating" / "faces.npz",
        points_mm=mean.astype(np.float16),
        normals=normals.astype(np.float16),
        modes_mm=modes.reshape(_MODES, -1, 3).transpose(1, 2, 0).astype(np.float16),
    )


if __name__ == "__main__":
    main()
