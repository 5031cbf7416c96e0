"""Front, recommendation and places that recur, on rows made by hand."""

from __future__ import annotations

import csv
import io
from typing import Any

import pytest

from rig.study.assembling import study_result
from rig.study.findings import near_best, pareto_front, recommended, recurring
from rig.study.grid import Choice
from rig.study.page import study_page
from rig.study.resultfile import Row, StudyResultFile, study_csv, study_json
from rig.study.studyfile import Study
from rig.study.unit import Place


def place(name: str, x_mm: float, z_mm: float) -> Place:
    return Place(name=name, position_mm=[x_mm, -800.0, z_mm], looks_along=[0.0, 1.0, 0.0])


def row(cameras: int, p95_um: float, size_mm: float = 500.0, **more: Any) -> Row:  # noqa: ANN401
    given: dict[str, Any] = {
        "choice": Choice(rig="r", head="h", cameras=cameras), "key": "k", "reason": "",
        "cameras": cameras, "sigma_median_mm": p95_um / 2e3, "sigma_p95_mm": p95_um / 1e3,
        "seen_twice_share": 1.0, "seen_thrice_share": 0.9, "holds_on": 1,
        "size_mm": [size_mm, 100.0, 200.0], "price": None, "on_front": False,
        "centre_mm": [0.0, 0.0, 0.0], "heads": [],
        "places": [place(f"cam{k:02d}", 100.0 * k, 50.0 * k) for k in range(cameras)],
    }  # fmt: skip
    return Row(**(given | more))


def test_the_front_holds_what_nothing_beats() -> None:
    rows = [
        row(4, 60.0),
        row(5, 70.0),  # beaten by the first
        row(5, 50.0),
        row(4, 60.004),  # the first again, from another start
        row(4, 80.0, size_mm=300.0),  # less accurate and smaller
        row(6, 10.0, reason="the limits cannot all be met (frame)"),
        row(4, 60.0, price=400.0, sigma_median_mm=0.04),  # its price is known
    ]
    assert pareto_front(rows) == [0, 2, 4, 6]


def test_more_heads_count_as_better() -> None:
    assert pareto_front([row(4, 60.0, holds_on=1), row(4, 61.0, holds_on=3)]) == [0, 1]
    chosen, _ = recommended([row(4, 60.0, holds_on=1), row(4, 61.0, holds_on=3)], Study())
    assert chosen == 1


@pytest.mark.parametrize(
    ("sigmas", "chosen"),
    [
        # 0.9 of 100 is 90: the fifth camera is worth it, the sixth is not.
        ({4: 100.0, 5: 80.0, 6: 79.0}, 5),
        # The fifth alone is not, but the sixth brings what two should: 0.81.
        ({4: 100.0, 5: 95.0, 6: 80.0}, 6),
        ({4: 100.0, 5: 95.0, 6: 90.0}, 4),
        ({7: 100.0}, 7),
    ],
)
def test_the_fewest_cameras_are_recommended_that_more_would_not_better_enough(
    sigmas: dict[int, float], chosen: int
) -> None:
    rows = [row(count, sigma) for count, sigma in sigmas.items()]
    number, why = recommended(rows, Study())
    assert number is not None
    assert rows[number].cameras == chosen
    assert why.startswith(f"{chosen} cameras")


def test_a_wanted_accuracy_asks_for_the_fewest_cameras_that_reach_it() -> None:
    rows = [row(4, 100.0), row(5, 80.0), row(5, 70.0), row(6, 50.0)]
    study = Study.model_validate({"recommend": {"sigma_p95_max_mm": 0.075}})
    number, why = recommended(rows, study)
    assert number == 2
    assert "within the 75.0 µm that are wanted" in why
    study = Study.model_validate({"recommend": {"sigma_p95_max_mm": 0.01}})
    number, why = recommended(rows, study)
    assert number == 3
    assert why.startswith("No rig reaches the 10.0 µm")


def test_places_recur_in_a_rig_and_in_its_mirror_image() -> None:
    own = row(3, 50.0, places=[place("a", -300.0, 0.0), place("b", 250.0, 200.0), place("c", 0, 0)])
    mirror = row(
        3, 51.0, places=[place("a", 300.0, 0.0), place("b", -250.0, 200.0), place("c", 0, -400.0)]
    )
    rows = [own, mirror, row(3, 60.0), row(4, 20.0)]
    best = near_best(rows, 0)
    assert best == [0, 1]  # within 10 % and of as many cameras
    found = recurring(own, [rows[k] for k in best])
    assert [(f.name, f.recurs_in) for f in found] == [("a", 2), ("b", 2), ("c", 1)]
    # atan(300 / 800) to the subject's right.
    assert found[0].azimuth_deg == pytest.approx(-20.556, abs=1e-3)


def result(rows: list[Row], name: str = "my study") -> StudyResultFile:
    return study_result(Study(name=name), "identity", ["r"], ["h"], rows)


def test_the_files_hold_every_design_and_the_recommended_one() -> None:
    bad = row(6, 10.0, reason="the limits cannot all be met (frame)")
    none = row(0, 0.0, reason="=1+1", sigma_p95_mm=None, sigma_median_mm=None, places=[])
    made = result([row(4, 60.0), row(5, 50.0, price=1000.0), bad, none])
    lines = list(csv.DictReader(io.StringIO(study_csv(made))))
    assert [line["feasible"] for line in lines] == ["yes", "yes", "no", "no"]
    assert [line["recommended"] for line in lines] == ["no", "yes", "no", "no"]
    assert [line["on_front"] for line in lines] == ["yes", "yes", "no", "no"]
    assert lines[3]["reason"] == "'=1+1"  # no formula for a spreadsheet
    assert StudyResultFile.model_validate_json(study_json(made)) == made
    page = study_page(made)
    assert "Recommended: 5 cameras" in page
    assert page.count('class="hull"') == 2
    assert "the limits cannot all be met (frame)" in page


def test_a_page_of_nothing_says_so() -> None:
    page = study_page(result([row(0, 0.0, reason="<b>no</b>", places=[])], "<script>"))
    assert "Nothing to recommend" in page
    assert "<b>no</b>" not in page
    assert "<script>" not in page


def test_cameras_on_one_line_are_drawn() -> None:
    line = [place("a", 0.0, 0.0), place("b", 100.0, 0.0), place("c", 200.0, 0.0)]
    assert "<svg" in study_page(result([row(3, 50.0, places=line), row(1, 9.0)]))
