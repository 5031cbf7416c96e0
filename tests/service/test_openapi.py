"""The API keeps its word."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from service_helpers import ROOT, StartServer

from rig.specification.sections.subject import ScanSection
from service.api.app import make_app

DOCUMENT: dict[str, Any] = make_app().openapi()
# Event streams have no end to wait for.
NOT_FUZZED = r"/events$|/v1/counts"
# What a scan or a rig may be cannot all be said in a schema: a rule that it does not hold, such as
# a minimum below its maximum, is answered with 422.
CONFIG = """
[[operations]]
include-method = "POST"
checks.positive_data_acceptance.expected-statuses = ["2xx", "4xx"]
"""


def fuzz(url: str, folder: Path, *options: str) -> None:
    (folder / "schemathesis.toml").write_text(CONFIG)
    command = [
        *(sys.executable, "-m", "schemathesis.cli", "run", f"{url}/openapi.json"),
        *("-H", "X-Rigwright: 1"),
        *("--exclude-path-regex", NOT_FUZZED, "--seed", "1", "--workers", "2", *options),
    ]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-2000:]
    assert re.search(r"\b(\d+) generated, \1 passed", done.stdout), done.stdout[-3000:]


def test_a_contract_fuzzer_finds_no_fault(start_server: StartServer, tmp_path: Path) -> None:
    # The phase that tries every corner of every field makes thousands of requests of the bodies.
    options = ("--phases", "examples,fuzzing", "--max-examples", "2")
    fuzz(start_server().url, tmp_path, *options)


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_a_contract_fuzzer_finds_no_fault_in_long(
    start_server: StartServer, tmp_path: Path
) -> None:
    fuzz(start_server().url, tmp_path, "--max-examples", "30")


def test_the_committed_document_is_that_of_the_code() -> None:
    written = ROOT / "docs" / "reference" / "openapi.json"
    committed = json.loads(written.read_text(encoding="utf-8"))
    assert committed == DOCUMENT, (
        "write it again: python -m service.reference.openapi docs/reference/openapi.json"
    )


def operations() -> list[tuple[str, str, dict[str, Any]]]:
    return [
        (path, method, operation)
        for path, methods in DOCUMENT["paths"].items()
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
    parameters = DOCUMENT["paths"]["/v1/scans"]["post"]["parameters"]
    for name in ("units", "up", "front", "subject"):
        (given,) = [p["schema"] for p in parameters if p["name"] == name]
        assert (given["enum"], given["default"]) == (
            section[name]["enum"],
            section[name]["default"],
        )


def test_every_operation_and_field_is_explained() -> None:
    for path, method, operation in operations():
        assert operation.get("description"), (path, method)
    names = [operation["operationId"] for _, _, operation in operations()]
    assert len(set(names)) == len(names)
