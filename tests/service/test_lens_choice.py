"""Lens models as a calibration's request names them."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from geometry.camera import TERM_NAMES, LensModel
from service.kinds.calibration import CalibrationRequest
from service.kinds.lens import LENS_TERMS, LensChoice, LensParameter
from service.tasks.calibrating import options_of


def test_requests_name_the_models_and_terms_that_there_are() -> None:
    assert {LensModel[c.name.upper()]: terms for c, terms in LENS_TERMS.items()} == TERM_NAMES


@pytest.mark.parametrize("model", [None, *LensChoice])
def test_the_model_of_a_request_is_that_of_the_adjustment(model: LensChoice | None) -> None:
    lens = options_of(CalibrationRequest(model=model), {}).lens
    assert (None if lens is None else lens.name.lower()) == (None if model is None else model.value)


@pytest.mark.parametrize(
    ("model", "free"),
    [
        (None, "k4"),
        (LensChoice.brown, "k6"),
        (LensChoice.fisheye, "p1"),
        (LensChoice.fisheye, "k5"),
    ],
)
def test_terms_that_a_model_lacks_cannot_be_free(model: LensChoice | None, free: str) -> None:
    told = f"the {(model or LensChoice.brown).value} lens model has no {free}"
    with pytest.raises(ValidationError, match=told):
        CalibrationRequest(model=model, free=[LensParameter(free)])
