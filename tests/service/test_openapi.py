"""The API keeps its word."""

from __future__ import annotations

import inspect
import json
import os
import re
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from service_helpers import ROOT, StartServer

from rig.specification.sections.subject import ScanSection
from service.api.app import make_app
from service.api.document import EVENTS
from service.kinds.examples import body_examples

# Event streams have no end to wait for.
NOT_FUZZED = r"/events$|/v1/counts"
# Jobs of all kinds have their routes from one place: two kinds stand for all. TESTS_FUZZ=all
# tries every corner of every field of every kind.
ALIKE = r"/v1/(plans|evaluations|calibrations|checks|acceptances|rig-tests)"
# What a scan or a rig may be cannot all be said in a schema: a rule that it does not hold, such as
# a minimum below its maximum, is answered with 422; so is what fits on no sheet of paper,
# and half of a place.
CONFIG = """
[[operations]]
include-method = "POST"
checks.positive_data_acceptance.expected-statuses = ["2xx", "4xx"]

[[operations]]
include-path-regex = "/sheets"
checks.positive_data_acceptance.expected-statuses = ["2xx", "4xx"]

[[operations]]
include-path-regex = "/preview$"
checks.positive_data_acceptance.expected-statuses = ["2xx", "4xx"]
"""


@cache
def document() -> dict[str, Any]:
    return make_app().openapi()


def fuzz(url: str, folder: Path, left_out: str, *options: str) -> None:
    (folder / "schemathesis.toml").write_text(CONFIG)
    command = [
        *(sys.executable, "-m", "schemathesis.cli", "run", f"{url}/openapi.json"),
        *("-H", "X-Rigwright: 1"),
        *("--exclude-path-regex", left_out, "--seed", "1", "--workers", "1", *options),
    ]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-2000:]
    assert re.search(r"\b(\d+) generated, \1 passed", done.stdout), done.stdout[-3000:]


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_a_contract_fuzzer_finds_no_fault(start_server: StartServer, tmp_path: Path) -> None:
    every = os.environ.get("TESTS_FUZZ") == "all"
    left_out = NOT_FUZZED if every else f"{NOT_FUZZED}|{ALIKE}"
    fuzz(start_server().url, tmp_path, left_out, "--max-examples", "30" if every else "10")


def test_the_committed_document_is_that_of_the_code() -> None:
    written = ROOT / "docs" / "reference" / "openapi.json"
    committed = json.loads(written.read_text(encoding="utf-8"))
    assert committed == document(), (
        "write it again: python -m service.reference.openapi docs/reference/openapi.json"
    )


def test_only_what_waits_for_others_is_answered_in_the_event_loop() -> None:
    """What computes there holds up everybody: this document took seconds to make."""
    app = make_app()
    routes = [route for router in (app.router, *app.state.routers) for route in router.routes]
    ours = [(getattr(r, "name", ""), getattr(r, "endpoint", None)) for r in routes]
    waiting = {
        name
        for name, endpoint in ours
        if inspect.iscoroutinefunction(endpoint) or inspect.isasyncgenfunction(endpoint)
    }
    assert len(ours) > 100
    assert {name for name in waiting if not name.startswith("follow_")} == {
        "add_scan", "add_picture_set", "read_look", "read_field"
    }  # fmt: skip


def operations() -> list[tuple[str, str, dict[str, Any]]]:
    return [
        (path, method, operation)
        for path, methods in document()["paths"].items()
        for method, operation in methods.items()
    ]


def test_errors_are_documented_as_problems_only() -> None:
    seen = 0
    for _, _, operation in operations():
        for status, answer in operation["responses"].items():
            if int(status) >= 400:
                seen += 1
                assert list(answer["content"]) == ["application/problem+json"]
    assert seen > 30


def test_a_scan_is_read_with_the_words_of_a_rig_file() -> None:
    section = ScanSection.model_json_schema()["properties"]
    parameters = document()["paths"]["/v1/scans"]["post"]["parameters"]
    for name in ("units", "up", "front", "subject"):
        (given,) = [p["schema"] for p in parameters if p["name"] == name]
        assert (given["enum"], given["default"]) == (
            section[name]["enum"],
            section[name]["default"],
        )


def test_every_operation_and_field_is_explained() -> None:
    for path, method, operation in operations():
        assert operation.get("description"), (path, method)


def test_a_generated_client_has_a_plain_name_for_everything() -> None:
    names = [operation["operationId"] for _, _, operation in operations()]
    assert len(set(names)) == len(names)
    for name in names:
        assert name.isidentifier() and "v1" not in name


def test_every_answer_says_what_it_is_and_where_what_was_made_is() -> None:
    for path, _, operation in operations():
        for status, answer in operation["responses"].items():
            if status in ("200", "201", "202"):
                assert answer["content"], path
                assert all(form.get("schema") for form in answer["content"].values()), path
            if status in ("201", "202"):
                assert answer["headers"]["Location"]["schema"]["format"] == "uri-reference"


def test_from_what_was_made_links_lead_to_what_can_be_done_with_it() -> None:
    known = {operation["operationId"] for _, _, operation in operations()}
    made = [o["responses"]["201"] for _, _, o in operations() if "201" in o["responses"]]
    links = [answer["links"] for answer in made if "links" in answer]
    assert len(links) >= 10  # jobs, scans, sets of pictures and targets
    for link in links:
        assert {one["operationId"] for one in link.values()} <= known
        assert "self" in link
    design = document()["paths"]["/v1/designs"]["post"]["responses"]["201"]["links"]
    assert design["events"] == {
        "operationId": "follow_design",
        "parameters": {"job_id": "$response.body#/id"},
    }


def test_the_examples_fit_their_schemas() -> None:
    shown = 0
    for _, method, operation in operations():
        content = operation.get("requestBody", {}).get("content", {}).get("application/json")
        if method != "post" or content is None:
            continue
        shown += 1
        schema = {**content["schema"], "components": document()["components"]}
        jsonschema.Draft202012Validator(schema).validate(content["example"])
    assert shown == len(body_examples())


def test_streams_name_their_events() -> None:
    followed = [o for path, _, o in operations() if path.endswith("/events")]
    assert len(followed) == 11
    for operation in followed:
        events = operation["responses"]["200"]["content"]["text/event-stream"]["itemSchema"]
        assert events["properties"]["event"]["enum"] == list(EVENTS)
