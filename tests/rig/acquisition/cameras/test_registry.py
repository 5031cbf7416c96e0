from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from camera_rigs import jpeg

from common.errors import DeviceError, InputError
from rig.acquisition.cameras.options import require
from rig.devices.registry import BACKENDS, ON_THEIR_OWN, discover_all, make_backend

ROOT = Path(__file__).resolve().parents[4]


def test_asking_for_a_backend_imports_no_other_ones_library() -> None:
    code = (
        "import sys, rig.devices.registry as registry\n"
        "before = set(sys.modules)\n"
        "assert not before & {'cv2', 'genicam', 'gphoto2', 'gi', 'exifread'}, before\n"
        "registry.make_backend('folder', {'root': '.'})\n"
        "assert not set(sys.modules) & {'cv2', 'harvesters', 'genicam', 'gphoto2', 'gi'}\n"
    )
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)


def test_an_unknown_backend_is_named_with_those_there_are() -> None:
    with pytest.raises(InputError, match=r"'webcam'.*simulated, folder, opencv") as caught:
        make_backend("webcam")
    assert caught.value.code == "input/camera-backend"


@pytest.mark.parametrize("name", BACKENDS)
def test_an_unknown_option_is_named_with_those_there_are(name: str) -> None:
    with pytest.raises(
        InputError, match=rf"'wrong' of the {name} cameras.*its options are"
    ) as caught:
        make_backend(name, {"wrong": 1})
    assert caught.value.code == "input/camera-option"


def test_a_missing_library_comes_with_the_command_that_installs_it() -> None:
    with pytest.raises(DeviceError) as caught:
        require("genicam", "no_such_library", "pip install 'rigwright[genicam]'")
    assert caught.value.code == "device/backend-missing"
    assert caught.value.remedy == "run: pip install 'rigwright[genicam]'"


def test_all_ways_are_looked_at_and_failures_are_lines(tmp_path: Path) -> None:
    (tmp_path / "cam01").mkdir()
    (tmp_path / "cam01" / "a.jpg").write_bytes(jpeg("1"))
    found = discover_all(
        {
            "folder": {"root": str(tmp_path)},
            "opencv": {"sources": {"desk": 0}, "by_id": str(tmp_path)},
            "aravis": {"python": "/nonexistent/python3"},
            "genicam": {"producers": ["no-such.cti"]},
            "gphoto2": {"virtual_folder": str(tmp_path / "cam01")},
        }
    )
    ids = {(info.backend, info.id) for info in found.cameras}
    assert {("folder", "cam01"), ("opencv", "desk")} <= ids
    assert "run: apt install" in found.problems["aravis"]
    assert "genicam" in found.problems
    assert "folder" not in found.problems
    assert set(ON_THEIR_OWN) < set(BACKENDS)
