"""The camera: sensor, lens, interior orientation, body. Projections happen in here only."""

from geometry.camera.model import Body, Camera, RigCamera
from geometry.camera.projection import (
    INTERIOR_NAMES,
    NO_DISTORTION,
    ImagePartials,
    distort,
    distort_partials,
    fold_radius,
    interior_vector,
    perspective,
    perspective_partials,
    project,
    project_partials,
    rotation_partials,
    undistort,
)

__all__ = [
    "INTERIOR_NAMES",
    "NO_DISTORTION",
    "Body",
    "Camera",
    "ImagePartials",
    "RigCamera",
    "distort",
    "distort_partials",
    "fold_radius",
    "interior_vector",
    "perspective",
    "perspective_partials",
    "project",
    "project_partials",
    "rotation_partials",
    "undistort",
]
