"""``rigwright study``: from a file to a page, gone on with, and never over what is not its own."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from inline_studies import inline
from service_helpers import files_under, rigwright_here

from rig.study.resultfile import read_study_result
from service.tasks import studying

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
STUDY = """
schema = "rigwright.study/1"
name = "Two walls"
rigs = ["wall-rig.toml"]
heads = ["targets.xyz"]
starts = 1
[grid]
cameras = [3]
seed = [{seeds}]
[prices]
camera = 100.0
"""


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(studying, "processes", lambda _: inline())
    shutil.copy(EXAMPLES / "studies/wall-rig.toml", tmp_path)
    shutil.copy(EXAMPLES / "wall/targets.xyz", tmp_path)
    (tmp_path / "study.toml").write_text(STUDY.format(seeds="1, 2"), encoding="utf-8")
    return tmp_path


def test_a_study_is_written_gone_on_with_and_never_over_another(lab: Path) -> None:
    done = rigwright_here("study", "study.toml", "--out", "out", "--json", cwd=lab)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert (told["result"]["designs"], told["result"]["reused"]) == (2, 0)
    assert told["result"]["recommended"]["price"] == 300.0
    wanted = {"study.json", "study.csv", "report.html", "recommended.toml"}
    assert set(told["files"]) == wanted
    assert "2 of 2 designs" in done.stderr
    first = {path: path.read_bytes() for path in files_under(lab / "out")}

    again = rigwright_here("study", "study.toml", "--out", "out", cwd=lab)
    assert again.returncode == 0, again.stderr
    assert "2 designs, 2 of them finished before" in again.stdout
    assert {path: path.read_bytes() for path in files_under(lab / "out")} == first

    # Another study: not over these results by itself, but with what both have in common.
    (lab / "study.toml").write_text(STUDY.format(seeds="2"), encoding="utf-8")
    other = rigwright_here("study", "study.toml", "--out", "out", cwd=lab)
    assert (other.returncode, "--force" in other.stderr) == (2, True)
    forced = rigwright_here("study", "study.toml", "--out", "out", "--force", "--json", cwd=lab)
    assert json.loads(forced.stdout)["result"]["reused"] == 1
    assert len(read_study_result(lab / "out/study.json").rows) == 1

    # A note that somebody laid there is nobody's to remove.
    (lab / "out/note.txt").write_text("mine", encoding="utf-8")
    kept = rigwright_here("study", "study.toml", "--out", "out", "--force", cwd=lab)
    assert (kept.returncode, "note.txt" in kept.stderr) == (2, True)
    assert (lab / "out/note.txt").read_text() == "mine"


def test_what_cannot_be_leaves_nothing(lab: Path) -> None:
    before = files_under(lab)
    text = STUDY.format(seeds="1").replace("cameras = [3]", "cameras = [1]")
    (lab / "study.toml").write_text(text, encoding="utf-8")
    done = rigwright_here("study", "study.toml", "--out", "new/out", cwd=lab)
    assert done.returncode == 2
    assert "one camera cannot measure" in done.stderr.splitlines()[-1]
    missing = text.replace("targets.xyz", "nobody.ply")
    (lab / "study.toml").write_text(missing, encoding="utf-8")
    done = rigwright_here("study", "study.toml", "--out", "new/out", cwd=lab)
    assert "there is no file nobody.ply" in done.stderr
    assert files_under(lab) == before
    assert not (lab / "new").exists()


def test_a_folder_of_others_is_left_alone(lab: Path) -> None:
    (lab / "out/units").mkdir(parents=True)
    (lab / "out/units/thesis.txt").write_text("years", encoding="utf-8")
    for more in ((), ("--force",)):
        done = rigwright_here("study", "study.toml", "--out", "out", *more, cwd=lab)
        assert done.returncode == 2, more
    assert files_under(lab / "out") == [lab / "out/units/thesis.txt"]
    done = rigwright_here("study", "study.toml", "--out", ".", "--force", cwd=lab)
    assert done.returncode == 2
    assert (lab / "study.toml").exists()


@pytest.mark.slow
def test_a_killed_study_goes_on_where_it_was(tmp_path: Path) -> None:
    shutil.copy(EXAMPLES / "studies/wall-rig.toml", tmp_path)
    shutil.copy(EXAMPLES / "wall/targets.xyz", tmp_path)
    (tmp_path / "study.toml").write_text(STUDY.format(seeds="1, 2, 3, 4, 5, 6"), encoding="utf-8")
    command = [sys.executable, "-m", "service.cli", "study", "study.toml", "--out", "out"]
    command += ["--workers", "1", "--json"]
    for stop in (signal.SIGKILL, signal.SIGINT):
        with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as study:
            begun, end = len(files_under(tmp_path / "out/units")), time.monotonic() + 120.0
            while len(files_under(tmp_path / "out/units")) <= begun:
                assert time.monotonic() < end
                assert study.poll() is None
                time.sleep(0.02)
            study.send_signal(stop)
            study.wait(30.0)
        assert not (tmp_path / "out/study.json").exists()
    assert study.returncode == 130
    kept = len([p for p in files_under(tmp_path / "out/units") if not p.name.startswith(".")])
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout)["result"]["reused"] == kept >= 2
    assert not list((tmp_path / "out/units").glob(".*"))
