"""The real firmware in a simulated ATmega328P, on simavr or on avr8js.

:class:`FirmwareSim` builds and starts one, gives the address of its serial line, and sends it
orders (``tests/simulators/README.md``). Two ways to use it:

- stopped, the default: the processor runs only while :meth:`FirmwareSim.run` or
  :meth:`FirmwareSim.ask` say so. Everything is repeatable to the cycle, and fast.
- ``pace("real")``: it runs with the wall clock and is spoken to over :attr:`FirmwareSim.url`.

Simulators are not hardware: they say what the program does to the pins, in processor cycles, and
nothing of drivers, cables and cameras.
"""

from __future__ import annotations

import atexit
import binascii
import bisect
import contextlib
import os
import select
import shutil
import signal
import subprocess
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntFlag, StrEnum
from functools import cache
from pathlib import Path

from common.closing import Closing

CLOCK_HZ = 16_000_000
CYCLES_PER_TICK = 8
CYCLES_PER_MS = CLOCK_HZ // 1000

_ROOT = Path(__file__).resolve().parents[2]
_BUILD = _ROOT / "build"
_START_S = 20.0
_ORDER_S = 120.0
_RAM_BEGIN = 0x100
_RAM_END = 0x900
_RAM_MARK = 0xA5


class Simulator(StrEnum):
    """Who plays the processor."""

    SIMAVR = "simavr"
    AVR8JS = "avr8js"


class Reset(IntFlag):
    """Why the processor starts, as in its MCUSR register."""

    POWER = 1
    EXTERNAL = 2
    BROWNOUT = 4
    WATCHDOG = 8


class SimulatorMissing(Exception):  # noqa: N818 - a reason to skip, not a failure
    """What is needed and not there, and what to install."""


@dataclass(frozen=True)
class PinEdge:
    """One change of an output pin. ``cycle`` counts from when the power came first."""

    cycle: int
    output: int
    level: int


def crc16(data: bytes) -> int:
    """The protocol's checksum, from the standard library."""
    return binascii.crc_hqx(data, 0xFFFF)


def sealed(body: str) -> str:
    """A line with its checksum, without its end."""
    return f"{body} *{crc16(body.encode('latin-1')):04X}"


def missing(simulator: Simulator) -> str:
    """Why this simulator cannot run here; empty when it can."""
    needed = {"make": "make", "avr-gcc": "gcc-avr and avr-libc", "avr-nm": "binutils-avr"}
    if simulator is Simulator.SIMAVR:
        needed["gcc"] = "gcc"
        if not Path("/usr/include/simavr/sim_avr.h").exists():
            return "libsimavr-dev is not installed (apt-get install libsimavr-dev libelf-dev)"
    else:
        needed |= {"node": "nodejs", "npm": "npm"}
    for program, package in needed.items():
        if shutil.which(program) is None:
            return f"{program} is not installed (apt-get install {package})"
    return ""


@cache
def built(simulator: Simulator) -> tuple[Path, list[str]]:
    """The firmware's ELF, and the command that runs it on this simulator, made if need be.

    Raises :class:`SimulatorMissing` where a tool is not installed or npm cannot fetch avr8js.
    """
    if problem := missing(simulator):
        raise SimulatorMissing(problem)
    _make(_ROOT / "rig/firmware", [], "the firmware does not build")
    elf = _BUILD / "firmware/trigger.elf"
    try:
        _make(_ROOT / "tests/simulators", [simulator.value], f"{simulator} cannot be made ready")
    except RuntimeError as error:
        if simulator is Simulator.AVR8JS:
            raise SimulatorMissing(str(error)) from None
        raise
    if simulator is Simulator.SIMAVR:
        return elf, [str(_BUILD / "simulators/simavr-runner"), str(elf)]
    script = _ROOT / "tests/simulators/avr8js/runner.mjs"
    return elf, ["node", str(script), str(elf.with_suffix(".hex"))]


def _make(folder: Path, targets: list[str], problem: str) -> None:
    done = subprocess.run(
        ["make", "--silent", "-C", str(folder), *targets],
        capture_output=True,
        text=True,
        timeout=_ORDER_S,
        check=False,
    )
    if done.returncode:
        raise RuntimeError(f"{problem}: {done.stderr.strip() or done.stdout.strip()}")


@cache
def symbols() -> dict[str, int]:
    """Where the firmware's variables are in RAM."""
    elf, _ = built(Simulator.SIMAVR) if not missing(Simulator.SIMAVR) else built(Simulator.AVR8JS)
    listing = subprocess.run(
        ["avr-nm", str(elf)], capture_output=True, text=True, timeout=_ORDER_S, check=True
    ).stdout
    rows = (row.split() for row in listing.splitlines())
    return {
        row[2]: int(row[0], 16) - 0x800000
        for row in rows
        if len(row) == 3 and int(row[0], 16) >> 16 == 0x80
    }


class FirmwareSim(Closing):
    """One simulated box. Use it in a ``with``; it never outlives the test's process."""

    def __init__(self, simulator: Simulator, log: Path) -> None:
        self.simulator = simulator
        self.log = log
        _, command = built(simulator)
        self._process = subprocess.Popen(
            [*command, str(log)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            bufsize=1,
            start_new_session=True,
        )
        atexit.register(self.close)
        self.url = self._read("start", _START_S).removeprefix("ready ")
        self._seq = 0
        self._pending = b""
        self._log_read = 0
        self._log_rows: dict[str, list[tuple[int, str, int]]] = defaultdict(list)
        self.events: list[str] = []
        """Bodies of the events that came while something else was waited for."""

    def close(self) -> None:
        """End the simulator, whatever it is doing. Closing twice changes nothing."""
        if self._process.stdout.closed:
            return
        atexit.unregister(self.close)
        with contextlib.suppress(OSError, ValueError):
            self._process.stdin.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(0.5)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait(5)
        self._process.stdout.close()

    @property
    def ended(self) -> bool:
        """Whether the simulator has ended."""
        return self._process.poll() is not None

    def _read(self, order: str, timeout_s: float) -> str:
        pipe = self._process.stdout
        ready = pipe is not None and select.select([pipe], [], [], timeout_s)[0]
        line = pipe.readline() if pipe is not None and ready else ""
        if not line:
            raise RuntimeError(f"{self.simulator} did not answer to {order[:60]!r}")
        return line.strip()

    def order(self, text: str) -> str:
        """Send one order to the simulator; what it answers behind ``ok``."""
        self._process.stdin.write(text + "\n")
        answer = self._read(text, _ORDER_S)
        if not answer.startswith("ok"):
            raise RuntimeError(f"{self.simulator}: {answer}")
        return answer[2:].strip()

    # Time

    def pace(self, pace: str) -> None:
        """``off``: only when told; ``real``: with the wall clock; ``full``: as fast as it can."""
        self.order(f"pace {pace}")

    @property
    def cycle(self) -> int:
        """Cycles since the power came first."""
        return int(self.order("cycle"))

    def run(self, milliseconds: float) -> bytes:
        """Let time pass; what the box sends meanwhile (it is still there to be read by line)."""
        return self._run("run", round(milliseconds * CYCLES_PER_MS))

    def run_cycles(self, cycles: int) -> bytes:
        """The same by cycles."""
        return self._run("run", cycles)

    def _run(self, order: str, cycles: int) -> bytes:
        answer = self.order(f"{order} {cycles}").split(" ")
        said = bytes.fromhex(answer[1]) if len(answer) > 1 else b""
        self._pending += said
        return said

    def at(self, cycle: int, order: str) -> None:
        """Have an order done at a cycle: ``interlock``, ``reset``, ``send``, ``poke``."""
        self.order(f"at {cycle} {order}")

    # The line

    def send(self, data: bytes) -> None:
        """Queue bytes on the line to the box; they go at the line's rate."""
        for start in range(0, len(data), 16384):
            self.order(f"send {data[start : start + 16384].hex()}")

    def lines(self, milliseconds: float) -> Iterator[str]:
        """The whole lines that the box has sent, or sends within a time, as they end."""
        end = self.cycle + round(milliseconds * CYCLES_PER_MS)
        while True:
            while b"\n" in self._pending:
                line, _, self._pending = self._pending.partition(b"\n")
                if line:
                    yield line.decode("ascii")
            if (left := end - self.cycle) <= 0:
                return
            self._run("line", left)

    def hush(self) -> None:
        """End the line to the box, let it say what it has to say, and forget that."""
        while self.run(50.0):
            pass
        self.send(b"\n")
        while self.run(50.0):
            pass
        self._pending = b""
        self.events.clear()

    def answer(self, milliseconds: float = 100.0) -> str:
        """The next reply, checked, without its checksum; events before it are kept."""
        for line in self.lines(milliseconds):
            body = unsealed(line)
            if not body.startswith("!"):
                return body
            self.events.append(body)
        raise AssertionError(f"no answer within {milliseconds} ms")

    def ask_raw(self, line: str) -> str:
        """Send a line as it is; the reply to it."""
        self.send(line.encode("latin-1") + b"\n")
        return self.answer()

    def ask(self, command: str) -> str:
        """Send a command with number and checksum; the reply without its number."""
        self._seq = (self._seq + 1) % 65536
        reply = self.ask_raw(sealed(f"{self._seq} {command}"))
        head, _, rest = reply.partition(" ")
        if head != str(self._seq):
            raise AssertionError(f"{reply!r} does not answer number {self._seq}")
        return rest

    def event(self, name: str, milliseconds: float = 500.0) -> str:
        """The next event of a name, without ``!`` and number."""
        while self.events:
            words = self.events.pop(0).split(" ", 2)
            if words[2].split(" ")[0] == name:
                return words[2]
        for line in self.lines(milliseconds):
            body = unsealed(line)
            if not body.startswith("!"):
                raise AssertionError(f"{body!r} while waiting for {name}")
            if body.split(" ")[2] == name:
                return body.split(" ", 2)[2]
        raise AssertionError(f"no {name} within {milliseconds} ms")

    # The board

    def interlock(self, *, closed: bool) -> None:
        """Open or close the interlock contact."""
        self.order(f"interlock {'closed' if closed else 'open'}")

    def reset(self, cause: Reset) -> None:
        """Reset the processor. RAM stays, but for ``Reset.POWER``, which spoils it."""
        self.order(f"reset {int(cause)}")
        self._pending = b""

    def peek(self, address: int, count: int) -> bytes:
        """Bytes of the data space."""
        return bytes.fromhex(self.order(f"peek {address} {count}"))

    def poke(self, address: int, data: bytes) -> None:
        """Write to the data space, registers included, as the program would."""
        self.order(f"poke {address} {data.hex()}")

    def stack_left(self) -> int:
        """Bytes between the variables and the deepest the stack has been since power-up."""
        begin = symbols()["_end"]
        untouched = self.peek(begin, _RAM_END - begin)
        return len(untouched) - len(untouched.lstrip(bytes([_RAM_MARK])))

    # The log

    def _logged(self, kind: str) -> list[tuple[int, str, int]]:
        """The rows of one kind so far; what has been read once is not read again."""
        with self.log.open() as file:
            file.seek(self._log_read)
            text = file.read()
        whole = text.rpartition("\n")[0]
        self._log_read += len(whole) + 1 if whole else 0
        for row in whole.splitlines():
            cycle, what, value = row.split(" ")
            rows = self._log_rows["edge" if what.isdigit() else what]
            rows.append((int(cycle), what, int(value)))
        return self._log_rows[kind]

    def edges(self, since: int = 0) -> list[PinEdge]:
        """Every change of an output from a cycle on, as it was made."""
        rows = self._logged("edge")
        first = bisect.bisect_left(rows, (since, "", 0))
        return [PinEdge(cycle, int(output), level) for cycle, output, level in rows[first:]]

    def sent(self) -> list[tuple[int, int]]:
        """Every byte of the box with the cycle at which it began: (cycle, byte)."""
        return [(cycle, value) for cycle, _, value in self._logged("tx")]

    def received(self) -> list[tuple[int, int]]:
        """Every byte to the box with the cycle at which it was whole (on simavr: about)."""
        return [(cycle, value) for cycle, _, value in self._logged("rx")]

    def resets(self) -> list[tuple[int, Reset]]:
        """Every start of the processor."""
        return [(cycle, Reset(value)) for cycle, _, value in self._logged("reset")]


def unsealed(line: str) -> str:
    """A line of the box without its checksum, which must be right."""
    body, star, checksum = line.rpartition(" *")
    if not star or checksum != f"{crc16(body.encode('ascii')):04X}":
        raise AssertionError(f"{line!r} has a wrong checksum or none")
    return body
