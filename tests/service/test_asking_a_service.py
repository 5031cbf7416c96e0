"""Commands while a service runs the rig: it is asked, found or named, and says the same."""

from __future__ import annotations

import json
import os
import signal
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from service_helpers import listening, rigwright_here, wait_for
from stations import write_station

from common.files.lock import held_note, lock_file
from rig.acquisition.station.stationfile import read_station
from rig.acquisition.trigger.fake.program import FakeTrigger, start_fake
from service.client.asking import ProblemSeen
from service.client.notes import find_service, noted
from service.keys.keyfile import add_key
from service.keys.scope import Scope
from service.problems import KINDS, problem_document


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, Path, str, FakeTrigger]]:
    """The service's data folder, its station file, its address and the box that is watched."""
    folder = tmp_path_factory.mktemp("lab")
    with start_fake() as box:
        lag = "\n[simulation.faults.cam02]\nlag_mean_us = 3000.0\n"
        station = write_station(folder / "in", url=box.url, more=lag)
        with listening(folder / "data", station) as url:
            yield folder / "data", station, url, box


def pulses(box: FakeTrigger) -> int:
    return sum(edge.output == 1 and edge.rising for edge in box.box.edges)


def test_a_capture_is_taken_by_the_service_and_told_alike(
    tmp_path: Path, lab: tuple[Path, Path, str, FakeTrigger]
) -> None:
    data, station, url, box = lab
    before = pulses(box)
    asked = ["capture", "--station", station, "--session", "anna", "--id", "one", "--json"]
    done = rigwright_here(*asked, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert f"asking the service at {url}, which runs the rig 'studio'" in done.stderr.splitlines()
    told = json.loads(done.stdout)
    assert (told["capture"], told["state"]) == ("one", "complete")
    assert told["session"] == str(data / "sessions" / "anna")
    assert len(told["pictures"]) == 2
    assert all(Path(picture).is_file() for picture in told["pictures"])
    assert "100 % committed" in done.stderr
    again = rigwright_here(*asked, cwd=tmp_path)
    assert json.loads(again.stdout) == told  # its id is known: nothing is fired
    assert pulses(box) == before + 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_the_service_may_be_named(lab: tuple[Path, Path, str, FakeTrigger]) -> None:
    _, _, url, _ = lab
    done = rigwright_here("capture", "--server", f"{url}/", "--subject", "Åsa", "--count", "2")
    assert done.returncode == 0, done.stderr
    sessions = {line for line in done.stdout.splitlines() if line.startswith("session: ")}
    (one,) = sessions  # both captures are of one session
    assert one.startswith(f"session: {url}/v1/sessions/sub-sa.ses-")
    dry = rigwright_here("capture", "--server", url, "--rig", "studio", "--dry-run", "--json")
    assert json.loads(dry.stdout) == {"ready": ["cam01", "cam02"], "faults": []}


@pytest.mark.slow
def test_a_check_writes_the_delays_there_and_says_the_same_as_here(
    tmp_path: Path, lab: tuple[Path, Path, str, FakeTrigger]
) -> None:
    _, station, _, box = lab
    twin = write_station(tmp_path / "twin")
    fired = pulses(box)
    there = rigwright_here("rig", "check", "--station", station, "--no-fire", "--json")
    here = rigwright_here("rig", "check", "--station", twin, "--no-fire", "--json")
    assert there.returncode == here.returncode == 0, there.stderr
    assert pulses(box) == fired
    tests = [json.loads(done.stdout)["self_test"] for done in (there, here)]
    names = [{check["name"] for check in test["checks"]} for test in tests]
    assert names[1] <= names[0]  # the service looks at its disk as well
    assert tests[0].keys() == {"test", "ok", "checks"}
    done = rigwright_here("rig", "check", "--station", station, "--captures", "1", "--write")
    assert done.returncode == 5, "written, and to be checked again"
    assert "cam02: lag 3.00 ms" in done.stdout
    assert read_station(station).camera("cam01").delay_us == pytest.approx(3000.0, abs=100.0)


@pytest.mark.slow
def test_status_box_and_abort(lab: tuple[Path, Path, str, FakeTrigger]) -> None:
    _, station, _, box = lab
    told = rigwright_here("rig", "status", "--station", station)
    assert told.returncode == 0, told.stderr
    assert told.stdout.splitlines()[0] == "studio: ready"
    assert "cam02: connected" in told.stdout
    tested = rigwright_here("trigger", "selftest", "--station", station, "--json")
    assert tested.returncode == 0, tested.stderr
    assert json.loads(tested.stdout)["capabilities"]["edge_log"] is True
    assert rigwright_here("rig", "abort", "--station", station).returncode == 0
    reset = rigwright_here("trigger", "reset", "--station", station)
    assert (reset.returncode, reset.stdout) == (0, "the box is ready\n"), reset.stderr
    box.box.set_interlock(False)
    wait_for(lambda: rigwright_here("rig", "status", "--station", station).returncode == 4)
    refused = rigwright_here("capture", "--station", station, "--session", "open")
    assert refused.returncode == KINDS["interlock"].exit_code
    assert refused.stderr.splitlines()[-1].startswith("rigwright: the interlock of rig 'studio'")
    box.box.set_interlock(True)
    rigwright_here("trigger", "reset", "--station", station)
    wait_for(lambda: rigwright_here("rig", "status", "--station", station).returncode == 0)


@pytest.mark.slow
def test_ctrl_c_ends_the_capture_there(lab: tuple[Path, Path, str, FakeTrigger]) -> None:
    data, station, _, box = lab
    before = pulses(box)

    def press() -> None:
        wait_for(lambda: pulses(box) >= before + 2)
        os.kill(os.getpid(), signal.SIGINT)

    somebody = threading.Thread(target=press)
    somebody.start()
    burst = ("--shots", "60", "--interval-us", "100000")
    done = rigwright_here("capture", "--station", station, "--session", "long", *burst)
    somebody.join()
    assert done.returncode == KINDS["cancelled"].exit_code, done.stderr
    assert before + 2 <= pulses(box) < before + 60
    filed = json.loads((data / "sessions" / "long" / "session.json").read_text())
    assert filed["captures"] == []


@pytest.mark.slow
def test_what_is_not_whole_is_told_and_ends_with_its_code(tmp_path: Path) -> None:
    more = "\n[simulation.faults.cam02]\ndrop = 1.0\n"
    station = write_station(tmp_path / "in", name="poor", more=more)
    with listening(tmp_path / "data", station):
        done = rigwright_here("capture", "--station", station, "--session", "x", "--json")
    assert done.returncode == KINDS["device"].exit_code
    told = json.loads(done.stdout)
    assert (told["state"], len(told["pictures"])) == ("partial", 1)
    assert "is not complete" in done.stderr.splitlines()[-1]


@pytest.mark.slow
def test_a_service_that_asks_for_keys(tmp_path: Path) -> None:
    station = write_station(tmp_path / "in")
    (tmp_path / "data").mkdir()
    _, hardware = add_key(tmp_path / "data", "anna", Scope.HARDWARE, None)
    _, reading = add_key(tmp_path / "data", "wall", Scope.READ, None)
    with listening(tmp_path / "data", station, require_keys=True) as url:
        asked = ("capture", "--station", station, "--session", "x")
        for key, words in (((), "wants a key, and got none"), (("--key", reading), "may read")):
            refused = rigwright_here(*asked, *key)
            assert refused.returncode == 2
            assert words in refused.stderr.splitlines()[-1]
        done = rigwright_here(*asked, "--key", hardware)
        assert done.returncode == 0, done.stderr
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("RIGWRIGHT_KEY", reading)
            assert rigwright_here("rig", "abort", "--server", url).returncode == 0


class TestNotes:
    def test_a_note_ends_with_its_service(self, tmp_path: Path) -> None:
        station = read_station(write_station(tmp_path / "in"))
        assert station.path is not None
        with noted("http://0.0.0.0:81/lab", [station], tmp_path, folder=tmp_path):
            found = find_service(station.path, tmp_path)
            assert found is not None and found.own
            assert (found.note.url, found.note.rig) == ("http://127.0.0.1:81/lab", "studio")
            # A second service with this station says nothing, and takes nothing away.
            with noted("http://127.0.0.1:82", [station], tmp_path, folder=tmp_path):
                assert find_service(station.path, tmp_path) == found
        assert find_service(station.path, tmp_path) is None

    def test_what_is_no_note_is_nobodys(self, tmp_path: Path) -> None:
        path = tmp_path / "note"
        assert held_note(path) is None
        path.write_text("left by a service that was killed")
        assert held_note(path) is None
        lock = lock_file(path, "held")
        assert held_note(path) == ("held", os.getuid())
        lock.release()

    def test_the_key_is_not_given_to_another_users_service(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        station = write_station(tmp_path / "in")
        (tmp_path / "data").mkdir()
        _, key = add_key(tmp_path / "data", "anna", Scope.HARDWARE, None)
        with listening(tmp_path / "data", station, require_keys=True) as url:
            monkeypatch.setattr(os, "getuid", lambda: 123456)
            monkeypatch.setattr("service.client.notes._ADMINISTRATOR", 123457)
            refused = rigwright_here("rig", "status", "--station", station, "--key", key)
        assert refused.returncode == 2
        assert f"say --server {url}" in refused.stderr


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_a_problem_is_the_error_that_it_began_as(kind: str) -> None:
    from service.ipc import error_from_fields

    error = error_from_fields({"kind": kind, "detail": "some", "problem": "a; b", "remedy": "c"})
    again = ProblemSeen.model_validate(problem_document(error)).error()
    assert (again.code, again.problem, again.remedy) == (error.code, "a; b", "c")


@pytest.mark.parametrize("server", ["rig-pc", "ftp://rig-pc", "http://"])
def test_what_is_no_address_is_refused(server: str) -> None:
    done = rigwright_here("rig", "status", "--server", server)
    assert done.returncode == 2
    assert "give one like http://" in done.stderr


def test_nobody_there_is_told_in_one_line() -> None:
    done = rigwright_here("rig", "status", "--server", "http://127.0.0.1:1")
    assert done.returncode == KINDS["device"].exit_code
    (line,) = done.stderr.splitlines()
    assert "does not answer" in line
