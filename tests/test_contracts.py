"""Every import contract bites: a breach planted in a copy of the packages is found by it."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PLANTED = "planted"
CONFIGURATION = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
LINTER = CONFIGURATION["tool"]["importlinter"]


@dataclass(frozen=True)
class Breach:
    """A module ``planted`` in the package ``where`` that imports ``what``."""

    where: str
    what: str


BREACHES = {
    "Five floors, every import points down": Breach("common", "geometry.frames"),
    "What is fired knows nothing of what is simulated; both meet where devices are made": Breach(
        "rig.acquisition", "rig.simulation.pool"
    ),
    "A session: each step of writing stands above what it writes with": Breach(
        "rig.acquisition.session.storage", "rig.acquisition.session.folder"
    ),
    "Running a rig: a capture is above its parts, and every part below says nothing of it": Breach(
        "rig.acquisition.cameras", "rig.acquisition.trigger.box"
    ),
    "Inside the solver: the job, the loop, the nonlinear program, its constraints, who sees what": (
        Breach("solver.coverage", "solver.nlp")
    ),
    "Rooms of rig: what is specified, designed, reported and built, every arrow points down": (
        Breach("rig.catalogue", "rig.design.designfile")
    ),
    "What is built needs nothing of what is fired or simulated, nor the other way round": Breach(
        "rig.build", "rig.acquisition.imaging"
    ),
    "The solver needs no web server, serial port or image library": Breach("solver", "cv2"),
    "The service meets the solver in its tasks alone": Breach("service.cli", "solver.design"),
    "What runs and keeps jobs knows nothing of what they do": Breach(
        "service.store", "calibration.files"
    ),
    "Handlers of requests meet no domain: kinds, tasks, stations and pictures do": Breach(
        "service.api", "rig.catalogue"
    ),
    "The page is a guest: it meets the service over HTTP alone": Breach(
        "service.page", "service.store"
    ),
}


def test_each_contract_has_its_breach() -> None:
    assert set(BREACHES) == {contract["name"] for contract in LINTER["contracts"]}


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> str:
    """What the linter says of a copy in which every contract is broken once, in one line."""
    copy = tmp_path_factory.mktemp("breached")
    shutil.copy(ROOT / "pyproject.toml", copy)
    for package in LINTER["root_packages"]:
        only_code = shutil.ignore_patterns("__pycache__", "*.json", "*.npz", "*.png", "*.bin")
        shutil.copytree(ROOT / package, copy / package, ignore=only_code)
    for number, breach in enumerate(BREACHES.values()):
        where = copy.joinpath(*breach.where.split("."))
        line = f"import {breach.what}\n"
        if where.is_dir():
            (where / f"{PLANTED}_{number}.py").write_text(line, encoding="utf-8")
        else:
            module = where.with_suffix(".py")
            module.write_text(module.read_text(encoding="utf-8") + line, encoding="utf-8")
    linter = Path(sys.executable).with_name("lint-imports")
    done = subprocess.run(
        [linter, "--no-cache"], capture_output=True, text=True, cwd=copy, check=False
    )
    assert done.returncode == 1, done.stderr
    return " ".join(done.stdout.split())


@pytest.mark.parametrize("name", BREACHES)
def test_a_planted_breach_is_found(told: str, name: str) -> None:
    number = list(BREACHES).index(name)
    breach = BREACHES[name]
    summary, _, details = told.partition("Broken contracts")
    assert f"{name} BROKEN" in summary
    # Where a contract's part of the account ends, the next one begins.
    others = "|".join(re.escape(other) for other in BREACHES if other != name)
    own = re.split(others, details.split(name, 1)[1])[0]
    assert f"{PLANTED}_{number}" in own or f"{breach.where} -> {breach.what}" in own
