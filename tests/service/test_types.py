"""Requests and results are objects from command line and HTTP to task and tables.

JSON's dictionaries stand only where JSON is read and written.
"""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from service_helpers import ROOT

from service.kinds.base import JobKind, Request, Result, RunContext
from service.kinds.queued import QUEUED
from service.tasks import registry

SEAM = ("api", "cli", "jobs", "kinds", "stations", "tasks")
JSON_IS_THEIRS = ("service/api/document.py", "service/api/responses.py")
"""They write the OpenAPI document."""

ASKED = ("request", "result", "body", "content")


def breaches(tree: ast.AST) -> list[str]:
    """What a module does that hides what it hands on."""
    found = []
    for node in ast.walk(tree):
        text = ast.unparse(node)
        if isinstance(node, ast.Subscript):
            name = node.value.attr if isinstance(node.value, ast.Attribute) else ""
            name = node.value.id if isinstance(node.value, ast.Name) else name
            if text == "dict[str, Any]":
                found.append(text)
            if name in ASKED and isinstance(node.slice, ast.Constant):
                found.append(text)
        if isinstance(node, ast.Call):
            called = ast.unparse(node.func)
            made_up = called == "getattr" and not isinstance(node.args[1], ast.Constant)
            if made_up or called.endswith("import_module"):
                found.append(text)
    return found


@pytest.mark.parametrize(
    "breach",
    [
        "def f(asked: dict[str, Any]) -> None: ...",
        "seed = request['seed']",
        "light = done.result['light']",
        "getattr(tables, f'print_{what}')(result)",
        "importlib.import_module(module)",
    ],
)
def test_the_breach_is_seen(breach: str) -> None:
    assert breaches(ast.parse(breach))


def test_requests_and_results_are_objects() -> None:
    found = {}
    for folder in SEAM:
        for path in sorted((ROOT / "service" / folder).rglob("*.py")):
            name = path.relative_to(ROOT).as_posix()
            told = breaches(ast.parse(path.read_text(encoding="utf-8")))
            if told and name not in JSON_IS_THEIRS:
                found[name] = told
    assert found == {}


def test_every_kind_has_its_work() -> None:
    for name in registry.KIND_NAMES:
        work = registry.work_of(name)
        assert work.kind.name == name
        assert issubclass(work.kind.request, Request)
        assert issubclass(work.kind.result, Result)
        assert work.kind.request.model_config["frozen"]
    assert set(QUEUED) <= set(registry.KIND_NAMES)


class _Asked(Request):
    seed: int = 0


def test_a_row_holds_request_and_run() -> None:
    kind = JobKind("asked", _Asked, Result)
    request, run = _Asked(seed=3), RunContext(workers=2, session="s", captures=["one"])
    assert kind.row(request, run) == {"seed": 3, "workers": 2, "session": "s", "captures": ["one"]}
    assert kind.from_row(kind.row(request, run)) == (request, run)


def test_no_default_stands_twice() -> None:
    """0.02 mm and its like stand in one module, whoever needs them."""
    told = [
        path
        for folder in ("service", "calibration/check", "calibration/acceptance")
        for path in Path(ROOT / folder).rglob("*.py")
        if "= 0.02\n" in path.read_text(encoding="utf-8")
        and "tolerance_mm" in path.read_text(encoding="utf-8")
    ]
    assert told == []
