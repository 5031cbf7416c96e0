"""The tables of a design on standard output."""

from __future__ import annotations

import pytest

from rig.design.designmodel import ConstraintFigures
from service.cli.tables.design_tables import print_figures, print_limits
from service.kinds.evaluation import EvaluationResult


def figures(name: str, value: float | None, sense: str, limit: float, slack: float | None):  # noqa: ANN201
    return ConstraintFigures(
        name=name,
        value=value,
        limit=limit,
        sense=sense,
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


@pytest.mark.parametrize(
    ("groups", "told"),
    [([["a", "b"]], "1"), ([["a", "b"], ["c"]], "2: 2 + 1 cameras"), (None, "-")],
)
def test_groups_of_cameras_are_counted(
    groups: list[list[str]] | None, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    nothing = dict.fromkeys(("cost_mm2", "sigma_median_mm", "sigma_p95_mm", "sigma_max_mm"))
    shares = {"in_focus_share": 1.0, "in_frame_share": 1.0, "matchable_share": 0.9876}
    lists = {"coverage": [], "violated": [], "notes": [], "groups": groups}
    print_figures(EvaluationResult(feasible=True, cameras=3, **nothing, **shares, **lists))
    lines = capsys.readouterr().out.splitlines()
    (line,) = (line for line in lines if "groups" in line)
    assert line.rstrip(" \u2502").endswith(told)
    assert any("98.76 %" in line for line in lines)
