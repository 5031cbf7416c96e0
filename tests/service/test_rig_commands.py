"""The commands about rigs, with a box that can be watched and simulated cameras."""

from __future__ import annotations

import json
import re
import signal
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from service_helpers import RIGWRIGHT, rigwright_here, wait_for
from stations import write_station

from rig.acquisition.session.verify import SessionCheck
from rig.acquisition.station.stationfile import read_station
from rig.acquisition.trigger.fake.program import FakeTrigger, start_fake
from service.cli.commands.capture import CaptureIds

COMMANDS = (
    ["capture"],
    ["cameras"],
    ["fake-trigger"],
    ["rig", "check"],
    ["rig", "status"],
    ["rig", "abort"],
    ["trigger", "selftest"],
    ["trigger", "reset"],
    ["sessions", "verify"],
    ["sessions", "recover"],
)


@pytest.fixture
def box() -> Iterator[FakeTrigger]:
    with start_fake() as fake:
        yield fake


@pytest.fixture
def station(tmp_path: Path, box: FakeTrigger) -> Path:
    return write_station(tmp_path / "in", url=box.url)


def pulses(box: FakeTrigger) -> int:
    return sum(edge.output == 1 and edge.rising for edge in box.box.edges)


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_every_command_shows_an_example(command: list[str]) -> None:
    done = rigwright_here(*command, "--help")
    assert done.returncode == 0
    assert f"rigwright {' '.join(command)}" in " ".join(done.stdout.split()).partition("Example")[2]


def test_made_up_names_sort_in_the_order_of_the_captures_within_a_second() -> None:
    ids = CaptureIds()
    names = [ids.next() for _ in range(50)]
    assert names == sorted(names)
    assert len({name.rpartition("-")[0] for name in names}) == 50  # not by chance
    shape = re.compile(r"cap-\d{8}T\d{6}-\d{3}-[0-9a-f]{6}")
    assert all(shape.fullmatch(name) for name in names)


def test_several_captures_are_told_in_a_line_each(
    tmp_path: Path, station: Path, box: FakeTrigger
) -> None:
    asked = ["capture", "--station", station, "--session", tmp_path / "two", "--count", "2"]
    done = rigwright_here(*asked)
    assert done.returncode == 0, done.stderr
    first, *lines = done.stdout.splitlines()
    assert first == f"session: {tmp_path / 'two'}"
    assert [line.partition(":")[0] for line in lines] == ["1 of 2", "2 of 2"]
    assert lines == sorted(lines, key=lambda line: line.split()[3])
    assert "capture 2 of 2" in done.stderr
    assert "arming" not in done.stderr
    assert pulses(box) == 2


def test_a_session_with_a_partial_capture_says_so(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    whole = SessionCheck((), captures=1, files=16, bytes=13_700_000)
    for check, told in (
        (whole, "1 capture, 16 files, 13.7 MB: whole\n"),
        (
            replace(whole, captures=2, partial=1),
            "2 captures (1 partial: pictures are missing), 16 files, 13.7 MB: whole\n",
        ),
    ):
        monkeypatch.setattr("rig.acquisition.session.verify.verify_session", lambda _, c=check: c)
        assert rigwright_here("sessions", "verify", tmp_path).stdout == told


def test_a_capture_is_filed_and_proven_whole(
    tmp_path: Path, station: Path, box: FakeTrigger
) -> None:
    session = tmp_path / "anna"
    asked = ["capture", "--station", station, "--session", session, "--id", "one", "--json"]
    done = rigwright_here(*asked)
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert (answer["capture"], answer["state"]) == ("one", "complete")
    assert all(Path(picture).is_file() for picture in answer["pictures"])
    assert "100 % committed" in done.stderr
    assert rigwright_here(*asked).returncode == 0  # the id is known: nothing is fired
    assert pulses(box) == 1
    verified = rigwright_here("sessions", "verify", session)
    assert verified.returncode == 0
    assert verified.stdout.endswith("whole\n")
    Path(answer["pictures"][0]).write_bytes(b"another picture")
    changed = rigwright_here("sessions", "verify", session)
    assert changed.returncode == 2
    assert "changed: images/rig1/cam01/000001.jpg" in changed.stdout
    assert changed.stderr.startswith("rigwright: ")


def test_a_dry_run_fires_and_files_nothing(tmp_path: Path, station: Path, box: FakeTrigger) -> None:
    done = rigwright_here("capture", "--station", station, "--dry-run", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "cam01" in done.stdout
    assert pulses(box) == 0
    assert not (tmp_path / "sessions").exists()


@pytest.mark.slow
def test_ctrl_c_ends_a_burst_and_files_nothing(
    tmp_path: Path, station: Path, box: FakeTrigger
) -> None:
    process = subprocess.Popen(
        [*RIGWRIGHT, "capture", "--station", str(station), "--session", str(tmp_path / "s"),
         "--shots", "60", "--interval-ms", "200"],
        stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    wait_for(lambda: pulses(box) >= 2)
    process.send_signal(signal.SIGINT)
    assert process.wait(10.0) == 130
    assert process.stderr is not None
    process.stderr.close()
    assert pulses(box) < 60
    assert json.loads((tmp_path / "s" / "session.json").read_text())["captures"] == []
    assert rigwright_here("sessions", "verify", tmp_path / "s").returncode == 0


@pytest.mark.slow
def test_devices_that_another_process_has_are_refused_with_its_name(
    tmp_path: Path, station: Path, box: FakeTrigger
) -> None:
    process = subprocess.Popen(
        [*RIGWRIGHT, "capture", "--station", str(station), "--session", str(tmp_path / "s"),
         "--shots", "150", "--interval-us", "200000"],
        stderr=subprocess.DEVNULL,
    )  # fmt: skip
    wait_for(lambda: pulses(box) >= 1)
    refused = rigwright_here("capture", "--station", station, "--session", tmp_path / "t")
    process.terminate()
    process.wait(10.0)
    assert refused.returncode == 2
    (line,) = refused.stderr.splitlines()
    assert f"process {process.pid}" in line
    assert not (tmp_path / "t").exists()


def test_a_rig_check_measures_lags_and_writes_delays(tmp_path: Path, box: FakeTrigger) -> None:
    lag = "\n[simulation.faults.cam02]\nlag_mean_us = 3000.0\n"
    station = write_station(tmp_path / "in", url=box.url, more=lag)
    quiet = rigwright_here("rig", "check", "--station", station, "--no-fire")
    assert quiet.returncode == 0, quiet.stdout
    assert pulses(box) == 0
    first = rigwright_here("rig", "check", "--station", station, "--captures", "1", "--write")
    assert first.returncode == 5, "written, and to be checked again"
    assert "cam02: lag 3.00 ms" in first.stdout
    assert read_station(station).camera("cam01").delay_us == pytest.approx(3000.0, abs=100.0)
    again = rigwright_here("rig", "check", "--station", station, "--captures", "1", "--json")
    assert again.returncode == 0, again.stdout
    assert json.loads(again.stdout)["sync_check"]["ok"] is True


class TestBoxes:
    def test_a_self_test_tells_who_answers(self, box: FakeTrigger) -> None:
        done = rigwright_here("trigger", "selftest", "--url", box.url)
        assert done.returncode == 0, done.stderr
        assert "Rigwright,TriggerBox" in done.stdout
        assert "state: ready; interlock: closed" in done.stdout

    def test_an_open_interlock_is_not_well(self, box: FakeTrigger) -> None:
        box.box.set_interlock(False)
        done = rigwright_here("trigger", "selftest", "--url", box.url, "--json")
        assert done.returncode == 4
        assert json.loads(done.stdout)["ok"] is False

    def test_no_box_is_told_in_one_line(self, tmp_path: Path) -> None:
        done = rigwright_here("trigger", "selftest", "--url", tmp_path / "nothing")
        assert done.returncode == 4
        (line,) = done.stderr.splitlines()
        assert line.startswith("rigwright: ")
        assert "nothing" in line
        assert rigwright_here("trigger", "selftest").returncode == 2

    def test_the_fake_box_of_the_command_line_answers(self, tmp_path: Path) -> None:
        link = tmp_path / "box"
        process = subprocess.Popen(
            [*RIGWRIGHT, "fake-trigger", "--link", str(link), "--serial-number", "RW7"],
            stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert process.stdout is not None
        assert str(link) in process.stdout.readline()
        done = rigwright_here("trigger", "selftest", "--url", link)
        process.send_signal(signal.SIGINT)
        assert process.wait(10.0) == 0
        process.stdout.close()
        assert done.returncode == 0, done.stderr
        assert "serial number RW7" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["capture", "--station", "none.toml"], "cannot read the station file none.toml"),
        (["capture", "--station", "wrong.toml"], "wrong.toml"),
        (["rig", "check", "--station", "wrong.toml"], "did you mean"),
        (["sessions", "verify", "."], "is not a session"),
        (["sessions", "recover", "."], "is not a session"),
        (["trigger", "selftest", "--station", "none.toml"], "cannot read"),
    ],
)
def test_bad_input_gets_one_line(tmp_path: Path, arguments: list[str], words: str) -> None:
    wrong = write_station(tmp_path / "in").read_text().replace("[trigger]", "[triger]")
    (tmp_path / "wrong.toml").write_text(wrong)
    done = rigwright_here(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith("rigwright: ")
    assert words in line
