"""The tables of a design on standard output."""

from __future__ import annotations

import pytest

from rig.design.designmodel import ConstraintFigures
from service.cli.tables.design_tables import print_limits


def figures(name: str, value: float | None, sense: str, limit: float, slack: float | None):  # noqa: ANN201
    return ConstraintFigures(
        name=name,
        value=value,
        limit=limit,
        sense=sense,  # type: ignore[arg-type]
        unit="px",
        slack=slack,
        active=False,
        satisfied=True,
    )


def test_an_equality_is_shown_with_its_tolerance(capsys: pytest.CaptureFixture[str]) -> None:
    print_limits(
        [
            figures("centring_x/cam03", -60.0, "==", 0.0, 40.0),
            figures("frame/cam01", 25.0, ">=", 20.0, 5.0),
            figures("spacing/all", None, "==", 7.0, None),
        ]
    )
    lines = capsys.readouterr().out.splitlines()
    (centring,) = (line for line in lines if "centring_x" in line)
    (frame,) = (line for line in lines if "frame" in line)
    (spacing,) = (line for line in lines if "spacing" in line)
    assert "0 \u00b1 100" in centring
    assert "\u00b1" not in frame + spacing
