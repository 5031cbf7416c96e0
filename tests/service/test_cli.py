from __future__ import annotations

import json
import os
import pty
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import httpx2
import pytest
import typer
from counting_job import COUNT, CountRequest
from service_helpers import HERE, RIGWRIGHT, files_under, rigwright, rigwright_here, wait_for
from typer.core import TyperGroup

from common.errors import CancelledError, ConflictError, InputError
from common.files.folders import new_folder
from common.files.ownership import files_of
from service.cli import COMMANDS, app
from service.cli.running import one_line_errors, run_task
from service.jobs.process import ProcessEngine
from service.keys.keyfile import add_key
from service.keys.scope import Scope


def cpu_s(*command: str) -> float:
    """The processor time of a command, the least of three: other tests run beside this one."""
    took = []
    for _ in range(3):
        process = subprocess.Popen([sys.executable, *command], stdout=subprocess.DEVNULL)
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        assert process.returncode == 0
        took.append(used.ru_utime + used.ru_stime)
    return min(took)


LOADED_BY_HELP = """
import sys, typer
before = set(sys.modules)
from service.cli import COMMANDS, app
try:
    app(["--help"])
finally:
    print(sorted({name.partition(".")[0] for name in set(sys.modules) - before}), file=sys.stderr)
    print(COMMANDS.built, file=sys.stderr)
"""


def test_help_is_quick_and_loads_nothing_beside_typer_and_its_own_commands() -> None:
    # On a quiet machine an empty program takes 0.02 s and the help 0.10 s; where it built every
    # command it took 0.15 s, with panels and colours 0.29 s. The ratio holds on slower ones too.
    assert cpu_s("-m", "service.cli", "--help") < 7.0 * cpu_s("-c", "pass")
    done = subprocess.run(
        [sys.executable, "-c", LOADED_BY_HELP], capture_output=True, text=True, check=True
    )
    for command in ("design", "evaluate", "serve", "demo"):
        assert f"\n  {command} " in done.stdout
    loaded, built = done.stderr.splitlines()
    assert loaded == "['calibration', 'common', 'rig', 'service', 'solver', 'typer']"
    assert built == "[]"


def test_help_lists_every_command_as_the_command_itself_would() -> None:
    # The list is drawn from names and first lines alone, the commands from all that they have.
    group = typer.main.get_command(app)
    assert isinstance(group, TyperGroup)
    context = group.make_context("rigwright", [], resilient_parsing=True)
    shown, whole = context.make_formatter(), context.make_formatter()
    group.format_commands(context, shown)
    TyperGroup(commands=dict(COMMANDS)).format_commands(context, whole)
    assert shown.getvalue() == whole.getvalue()
    assert shown.getvalue().count("\n") > len(COMMANDS)


@pytest.mark.parametrize("command", ["design", "evaluate", "serve", "demo"])
def test_every_command_shows_an_example(command: str) -> None:
    done = rigwright_here(command, "--help", cwd=HERE)
    assert done.returncode == 0
    assert f"Example:  rigwright {command}" in done.stdout


def test_an_address_that_is_none_is_named(tmp_path: Path) -> None:
    add_key(tmp_path, "anna", Scope.HARDWARE, None)
    done = rigwright_here("serve", "--host", "not-an-address", "--data", tmp_path, cwd=tmp_path)
    assert done.returncode == 2 and "cannot listen on not-an-address" in done.stderr


@pytest.mark.slow
def test_a_folder_whose_name_is_no_text_is_printed_all_the_same(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "service.cli", "practice", "--out", b"latin \xfc"]
    strict = {**os.environ, "PYTHONPATH": str(HERE.parents[1]), "PYTHONIOENCODING": "utf-8:strict"}
    done = subprocess.run(command, cwd=tmp_path, env=strict, capture_output=True, check=False)
    assert done.returncode == 0 and rb"latin \udcfc" in done.stdout, done.stderr


def test_the_version() -> None:
    assert re.match(r"^rigwright \S+\n$", rigwright("--version").stdout)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ["design", "nothing.glb", "--rig", "rig.toml", "--out", "out"],
            "there is no file nothing.glb",
        ),
        (
            ["design", "here.glb", "--rig", "none.toml", "--out", "out"],
            "there is no file none.toml",
        ),
        (["design", ".", "--rig", "rig.toml", "--out", "out"], ". is a folder"),
        (
            ["design", "here.glb", "--rig", "rig.toml", "--out", "full"],
            "the folder full is not empty",
        ),
        (["design", "here.glb", "--rig", "rig.toml", "--out", "here.glb"], "here.glb is a file"),
        (
            ["design", "here.glb", "--rig", "rig.toml", "--out", "here.glb/out"],
            "cannot write into here.glb",
        ),
        (["evaluate", "none.json", "here.glb", "--rig", "rig.toml"], "there is no file none.json"),
        (["serve", "--data", "here.glb"], "the data folder here.glb cannot be used"),
        (
            ["serve", "--host", "not-an-address", "--data", "data"],
            "there is no valid key",
        ),
    ],
)
def test_bad_input_gets_one_line_and_leaves_nothing(
    tmp_path: Path, arguments: list[str], words: str
) -> None:
    (tmp_path / "here.glb").write_bytes(b"glTF")
    (tmp_path / "rig.toml").write_text('schema = "rigwright.rig/1"')
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "kept.txt").write_text("kept")
    before = files_under(tmp_path)
    done = rigwright_here(*arguments, cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    (line,) = done.stderr.splitlines()
    assert line.startswith("rigwright: ")
    assert words in line
    assert "; " in line  # what to do about it
    assert [path for path in files_under(tmp_path) if "data" not in path.parts] == before
    assert not (tmp_path / "out").exists()


def test_a_misspelt_setting_is_not_ignored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RIGWRIGHT_PROT", "9000")
    done = rigwright_here("serve", "--data", tmp_path)
    assert done.returncode == 2
    assert "there is no setting RIGWRIGHT_PROT" in done.stderr


def test_wrong_usage_is_bad_input() -> None:
    assert rigwright_here("design").returncode == 2
    assert rigwright_here("desing").returncode == 2


class TestNewFolder:
    def test_it_appears_whole(self, tmp_path: Path) -> None:
        out = tmp_path / "deep" / "er" / "out"
        with new_folder(out, force=False) as folder:
            (folder / "design.json").write_text("{}")
            assert not out.exists()
        assert list(files_of(out)) == ["design.json"]
        assert [path.name for path in out.parent.iterdir()] == ["out"]

    def test_after_a_failure_all_is_as_before(self, tmp_path: Path) -> None:
        out = tmp_path / "deep" / "er" / "out"
        with pytest.raises(ZeroDivisionError), new_folder(out, force=False) as folder:
            (folder / "design.json").write_text("{}")
            raise ZeroDivisionError
        assert list(tmp_path.iterdir()) == []

    def test_what_is_there_is_replaced_only_by_force(self, tmp_path: Path) -> None:
        out = tmp_path / "out"
        with new_folder(out, force=False) as folder:
            (folder / "old.json").write_text("old")
        with pytest.raises(ConflictError, match="--force"), new_folder(out, force=False):
            raise AssertionError
        with pytest.raises(ZeroDivisionError), new_folder(out, force=True):
            raise ZeroDivisionError
        assert (out / "old.json").read_text() == "old"
        with new_folder(out, force=True) as folder:
            (folder / "new.json").write_text("new")
        assert list(files_of(out)) == ["new.json"]
        assert [path.name for path in tmp_path.iterdir()] == ["out"]

    def test_an_empty_folder_may_be_used(self, tmp_path: Path) -> None:
        (tmp_path / "out").mkdir()
        with new_folder(tmp_path / "out", force=False) as folder:
            (folder / "new.json").write_text("new")
        assert (tmp_path / "out" / "new.json").exists()


def test_errors_of_all_kinds_become_exit_codes(capsys: pytest.CaptureFixture[str]) -> None:
    for error, code in ((InputError("d", "wrong", "mend it"), 2), (CancelledError(), 130)):
        with pytest.raises(typer.Exit) as caught, one_line_errors():
            raise error
        assert caught.value.exit_code == code
    assert capsys.readouterr().err.splitlines()[0] == "rigwright: wrong; mend it"


def test_progress_is_plain_lines_without_a_terminal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    engine = ProcessEngine(program="counting_job")
    done = run_task(COUNT, CountRequest(to=3), {}, tmp_path, engine=engine)
    assert done.counted == 3
    lines = capsys.readouterr().err.splitlines()
    assert lines[:2] == [
        "  0 % loading the program",
        "  0 % counting: start 1, iteration 0, cost -, violation -",
    ]
    assert len(lines) == 4


# A command of its own that counts: what every command does on the way, but for as long as needed.
COUNTING = (
    f"import sys; sys.path.insert(0, {str(HERE)!r})\n"
    "from pathlib import Path\n"
    "from common.files.folders import new_folder\n"
    "from counting_job import COUNT, CountRequest\n"
    "from service.cli.running import one_line_errors, run_task\n"
    "from service.jobs.process import ProcessEngine\n"
    "import typer\n"
    "def main(out: Path) -> None:\n"
    "    with one_line_errors(), new_folder(out, force=False) as folder:\n"
    "        engine = ProcessEngine(program='counting_job')\n"
    "        run_task(COUNT, CountRequest(to=3000), {}, folder, engine=engine)\n"
    "typer.run(main)\n"
)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupting_leaves_nothing(tmp_path: Path, number: signal.Signals) -> None:
    out = tmp_path / "deep" / "out"
    process = subprocess.Popen(
        [sys.executable, "-c", COUNTING, str(out)], stderr=subprocess.PIPE, text=True
    )
    assert process.stderr is not None
    assert "loading" in process.stderr.readline()
    assert "counting" in process.stderr.readline()
    began = time.monotonic()
    process.send_signal(number)
    assert process.wait(10.0) == 130
    assert time.monotonic() - began < 1.5
    assert process.stderr.read().splitlines()[-1].startswith("rigwright: the work was cancelled")
    process.stderr.close()
    assert list(tmp_path.iterdir()) == []


def test_a_killed_command_leaves_no_process(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", COUNTING, str(tmp_path / "out")], stderr=subprocess.PIPE, text=True
    )
    assert process.stderr is not None
    assert "loading" in process.stderr.readline()
    assert "counting" in process.stderr.readline()
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    assert len(children) == 1
    process.kill()
    process.wait()
    process.stderr.close()
    wait_for(lambda: not Path(f"/proc/{children[0]}").exists(), 3.0)
    assert not (tmp_path / "out").exists()


def test_a_terminal_gets_a_bar(tmp_path: Path) -> None:
    ours, theirs = pty.openpty()
    script = COUNTING.replace("3000", "60")
    process = subprocess.Popen(
        [sys.executable, "-c", script, str(tmp_path / "out")],
        stderr=theirs,
        env=os.environ | {"TERM": "xterm", "COLUMNS": "120"},
    )
    os.close(theirs)
    shown = b""
    try:
        while chunk := os.read(ours, 4096):
            shown += chunk
    except OSError:  # Linux reports the other end's closing as an error
        pass
    os.close(ours)
    assert process.wait() == 0
    assert b"counting" in shown
    assert "\u2501".encode() in shown
    assert b"iteration" in shown


class TestServe:
    @pytest.fixture
    def serve(self, tmp_path: Path) -> Callable[..., subprocess.Popen[str]]:
        def start(*arguments: str) -> subprocess.Popen[str]:
            command = [
                *RIGWRIGHT,
                "serve",
                "--port",
                "0",
                "--data",
                str(tmp_path / "data"),
                *arguments,
            ]
            return subprocess.Popen(
                command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
            )

        return start

    @pytest.mark.parametrize(
        "number", [pytest.param(signal.SIGINT, marks=pytest.mark.slow), signal.SIGTERM]
    )
    def test_it_says_where_it_is_answers_and_stops(
        self, serve: Callable[..., subprocess.Popen[str]], number: signal.Signals
    ) -> None:
        with serve() as process:
            assert process.stdout is not None
            found = re.search(r"http://127\.0\.0\.1:\d+", process.stdout.readline())
            assert found
            assert httpx2.get(f"{found[0]}/v1").json()["name"] == "rigwright"
            process.send_signal(number)
            _, log = process.communicate(timeout=10.0)
            assert process.returncode == 0
        entries = [json.loads(line) for line in log.splitlines()]
        assert any(entry.get("path") == "/v1" and entry["request_id"] for entry in entries)

    @pytest.mark.slow
    def test_a_second_one_on_the_same_data_is_refused(
        self, serve: Callable[..., subprocess.Popen[str]]
    ) -> None:
        with serve() as first:
            assert first.stdout is not None
            first.stdout.readline()
            with serve() as second:
                _, log = second.communicate(timeout=20.0)
            assert second.returncode == 2
            assert log.startswith("rigwright: another service (process ")
            assert log.count("\n") == 1
            first.terminate()
            first.communicate(timeout=10.0)
