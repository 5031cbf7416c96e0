"""What a request for a design asks for beside its rig."""

from __future__ import annotations

import tomllib
from contextlib import closing
from pathlib import Path

import jsonschema
import pytest
from pydantic import ValidationError
from service_helpers import wait_for
from starlette.testclient import TestClient

from rig.specification.examples import example_text
from rig.specification.rigfile import RigFile
from rig.specification.strategies import Strategy
from service.api.app import create_app, make_app
from service.api.context import Service
from service.kinds.design import DesignRequest
from service.settings import read_settings
from service.tasks.examples import example_rigs, rig_schema

RIG = tomllib.loads(example_text("face"))


def test_what_is_asked_for_comes_before_what_the_rig_says() -> None:
    plain = DesignRequest.model_validate({"rig": RIG}).spec()
    assert (plain.count, plain.seed, plain.starts, plain.strategy) == (7, 1, 8, Strategy.EXCHANGE)
    asked = {"cameras": 5, "seed": 4, "starts": 2, "strategy": "k-means"}
    other = DesignRequest.model_validate({"rig": RIG} | asked).spec()
    assert (other.count, other.seed, other.starts, other.strategy) == (5, 4, 2, Strategy.K_MEANS)
    kept = DesignRequest.model_validate({"rig": RIG | {"strategy": "k-means"}}).spec()
    assert kept.strategy is Strategy.K_MEANS


def test_a_strategy_that_nobody_knows_is_refused() -> None:
    with pytest.raises(ValidationError, match="exchange"):
        DesignRequest.model_validate({"rig": RIG, "strategy": "luck"})


def test_what_a_rig_may_say_is_read_from_the_service() -> None:
    client = TestClient(make_app())
    schema = client.get("/v1/rig-schema").json()
    jsonschema.validate(RIG, schema)
    with pytest.raises(jsonschema.ValidationError, match="cameras"):
        jsonschema.validate(RIG | {"cameras": "many"}, schema)
    assert schema == RigFile.model_json_schema()


def test_what_forms_are_drawn_from_is_made_before_it_is_asked_for(tmp_path: Path) -> None:
    made = (example_rigs, rig_schema)
    for one in made:
        one.cache_clear()
    service = Service(read_settings(data_dir=tmp_path), {})
    with closing(service), TestClient(create_app(service)):
        wait_for(lambda: all(one.cache_info().currsize for one in made))
