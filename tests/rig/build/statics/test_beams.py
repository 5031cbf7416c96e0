"""Beams against closed forms, and a chain of them against the principle of virtual work."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from common.errors import InputError
from rig.build.statics.beams import Beam, Frame, Section

SECTION = Section(70_000.0, 26_000.0, 185.0, 7_000.0, 14_000.0, 1_400.0, 0.5)
LENGTH = 800.0
X, Y, Z = np.eye(3)
ALL = tuple(range(6))


def cantilever(pieces: int = 2) -> Frame:
    """Along y, clamped at its start, ``across`` along x."""
    nodes = np.linspace(0.0, LENGTH, pieces + 1)[:, None] * Y
    return Frame(nodes, [Beam(k, k + 1, SECTION, X) for k in range(pieces)], {0: ALL})


def load(nodes: int, at: int, *values: float) -> np.ndarray:
    loads = np.zeros((nodes, 6, 1))
    loads[at, :, 0] = values
    return loads


@pytest.mark.parametrize(
    ("values", "freedom", "expected"),
    [
        # F L^3 / 3 E I and F L^2 / 2 E I about the axis across; the other inertia sideways.
        ((0, 0, -10, 0, 0, 0), 2, -10 * LENGTH**3 / 3 / 70_000 / 7_000),
        ((0, 0, -10, 0, 0, 0), 3, -10 * LENGTH**2 / 2 / 70_000 / 7_000),
        ((10, 0, 0, 0, 0, 0), 0, 10 * LENGTH**3 / 3 / 70_000 / 14_000),
        ((10, 0, 0, 0, 0, 0), 5, -10 * LENGTH**2 / 2 / 70_000 / 14_000),
        # F L / E A, and M L / G J.
        ((0, 10, 0, 0, 0, 0), 1, 10 * LENGTH / 70_000 / 185),
        ((0, 0, 0, 0, 900, 0), 4, 900 * LENGTH / 26_000 / 1_400),
    ],
)
def test_a_cantilever_is_as_in_the_books(
    values: tuple[float, ...], freedom: int, expected: float
) -> None:
    moved = cantilever().moves(load(3, 2, *values))
    assert moved[2, freedom, 0] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("pieces", [1, 3])
def test_its_own_weight_bends_a_beam_however_it_is_divided(pieces: int) -> None:
    """w L^4 / 8 E I, with the moments of an even load at every node."""
    frame = cantilever(pieces)
    moved = frame.moves(frame.weight(-9.81 * Z)[:, :, None])
    per_mm = 0.5e-3 * 9.81
    expected = -per_mm * LENGTH**4 / 8.0 / 70_000 / 7_000
    assert moved[pieces, 2, 0] == pytest.approx(expected, rel=1e-9)


def test_a_bent_chain_moves_as_virtual_work_says() -> None:
    """Upright, stub and arm: sums of M m / E I, T t / G J and N n / E A along each of them.

    An independent way to the same figure: no stiffness, only the moments of two forces.
    """
    nodes = np.array([[0.0, 0, 0], [0, 0, 900], [150, 0, 900], [150, 320, 880]])
    round_section = Section(70_000.0, 26_000.0, 185.0, 7_000.0, 7_000.0, 1_400.0, 0.5)
    across = [X, Z, X]
    beams = [Beam(k, k + 1, round_section, across[k]) for k in range(3)]
    force = np.array([1.0, -2.0, -6.0])
    moved = Frame(nodes, beams, {0: ALL}).moves(load(4, 3, *force, 0, 0, 0))[3, :3, 0]
    for way in np.eye(3):
        work = 0.0
        for start, end in itertools.pairwise(nodes):
            length = float(np.linalg.norm(end - start))
            along = (end - start) / length
            # Gauss points: the product of two linear moments is a parabola, two are exact.
            for share in 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0):
                arm = nodes[3] - (start + share * (end - start))
                real, unit = np.cross(arm, force), np.cross(arm, way)
                twist = (real @ along) * (unit @ along)
                bend = real @ unit - twist
                pull = (force @ along) * (way @ along)
                work += length / 2.0 * (
                    bend / (70_000 * 7_000) + twist / (26_000 * 1_400) + pull / (70_000 * 185)
                )  # fmt: skip
        assert moved @ way == pytest.approx(work, rel=1e-9)


def test_a_frame_that_can_turn_about_its_feet_is_refused() -> None:
    nodes = np.array([[0.0, 0, 0], [0, LENGTH, 0], [0, LENGTH / 2, 0], [0, LENGTH / 2, LENGTH]])
    beams = [Beam(0, 2, SECTION, X), Beam(2, 1, SECTION, X), Beam(2, 3, SECTION, X)]
    with pytest.raises(InputError, match="can move freely"):
        Frame(nodes, beams, {0: (0, 1, 2), 1: (0, 1, 2)})
