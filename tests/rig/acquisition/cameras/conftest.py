"""Which camera worlds there are here, and one of each to share."""

from __future__ import annotations

import importlib.util
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from camera_rigs import FAKE_GV, RIGS, CameraRig, one_gige_network

from common.errors import DeviceError
from rig.acquisition.cameras.aravis import find_python
from rig.acquisition.cameras.base import CameraDevice


def why_no_aravis() -> str:
    if shutil.which(FAKE_GV) is None:
        return f"Debian's aravis-tools ({FAKE_GV}) is not installed"
    try:
        find_python()
    except DeviceError as error:
        return str(error)
    return ""


def why_not(name: str) -> str:
    if name == "aravis":
        return why_no_aravis()
    package = {"genicam": "harvesters", "gphoto2": "gphoto2"}.get(name)
    if package and importlib.util.find_spec(package) is None:
        return f"the Python package {package} is not installed"
    return ""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    reasons = {name: why_not(name) for name in ("aravis", "genicam", "gphoto2")}
    for item in items:
        for name, reason in reasons.items():
            if reason and item.get_closest_marker(f"needs_{name}"):
                item.add_marker(pytest.mark.skip(reason=reason))


def worlds() -> list[object]:
    marks = {
        name: [getattr(pytest.mark, f"needs_{name}")] for name in ("aravis", "genicam", "gphoto2")
    }
    return [pytest.param(name, marks=marks.get(name, [])) for name in RIGS]


@pytest.fixture(scope="module", autouse=True)
def _one_gige_network_at_a_time(request: pytest.FixtureRequest) -> Iterator[None]:
    if request.module.__name__.rpartition(".")[2].startswith(("test_aravis", "test_conf")):
        with one_gige_network():
            yield
    else:
        yield


@pytest.fixture(scope="module", params=worlds())
def camera_rig(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[CameraRig]:
    """A camera world shared by the tests of a module."""
    rig = RIGS[request.param](tmp_path_factory.mktemp(request.param))
    yield rig
    rig.close()


@pytest.fixture(scope="module")
def device(camera_rig: CameraRig) -> Iterator[CameraDevice]:
    """Its camera, open; tests leave it in any state but closed."""
    opened = camera_rig.backend.open(camera_rig.camera_id)
    yield opened
    opened.close()


@pytest.fixture(params=worlds())
def fresh_rig(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[CameraRig]:
    """A camera world of one's own, to break."""
    rig = RIGS[request.param](tmp_path)
    yield rig
    rig.close()
