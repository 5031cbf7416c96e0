"""Kill a process that takes captures, at random moments, and look at what it left.

    python -m benchmarks.crashes [--times 200] [--seed 1] [--folder DIR]

A child takes captures in a loop with cameras in memory and tells each commit through a pipe. It
is killed (SIGKILL) at a random instant. Then the session is opened again, which recovers it, and
verified: everything the child told must be there, whole, and nothing else may be taken for whole.
The next child goes on in the same session.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from memoryrig import MemoryDevices, line_fit, memory_station, with_policy

from rig.acquisition.capture.rig import Rig
from rig.acquisition.session import paths
from rig.acquisition.session.folder import Session
from rig.acquisition.session.verify import verify_session

LONGEST_S = 0.4
"""A capture takes a third of it: kills fall into every part of several captures."""

FRESH_EVERY = 25
"""Children per session: verifying a session takes as long as it is large."""


@dataclass
class Tally:
    """What the kills did. ``wrong``: what must never be."""

    kills: int = 0
    committed: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)


def child(folder: Path, locks: Path, first: int, pipe: int) -> None:
    """Take captures until killed; each is told only when :meth:`Rig.capture` has returned."""
    station = with_policy(memory_station(3), settle_s=0.0)
    rig = Rig(station, MemoryDevices(), locks=locks, fit=line_fit)
    there = (folder / paths.SESSION).exists()
    session = Session.open(folder) if there else rig.new_session(folder)
    os.write(pipe, b"open\n")
    for number in range(first, first + 1000):
        rig.capture(session, f"c{number}")
        os.write(pipe, f"c{number}\n".encode())


def kill_one(folder: Path, locks: Path, first: int, after_s: float) -> list[str]:
    """Run a child, kill it ``after_s`` after it was started; returns what it told."""
    reading, writing = os.pipe()
    pid = os.fork()
    if pid == 0:
        # The child must never run the parent's code, whatever happens to it.
        try:
            os.close(reading)
            child(folder, locks, first, writing)
        finally:
            os._exit(3)
    os.close(writing)
    time.sleep(after_s)
    os.kill(pid, signal.SIGKILL)
    _, status = os.waitpid(pid, 0)
    with os.fdopen(reading) as pipe:
        told = pipe.read().split()
    if not os.WIFSIGNALED(status):
        raise RuntimeError(f"the child ended by itself with status {status}")
    return [word for word in told if word != "open"]


def look(folder: Path, told: set[str], tally: Tally) -> None:
    """Open, recover and verify what a killed child left."""
    if not (folder / paths.SESSION).exists():
        tally.outcomes["killed before there was a session"] += 1
        if told or folder.exists():
            tally.wrong.append(f"{folder} is lost, or half a session")
        return
    with Session.open(folder) as session:
        recovery = session.recovery
        there = {record.capture_id for record in session.index.records}
        states = {record.state for record in session.index.records}
        spent = {entry.capture_id for entry in session.manifest.interrupted}
    check = verify_session(folder)
    if not check.whole:
        tally.wrong.append(f"{folder}: {check.findings[0].text}")
    if told - there:
        tally.wrong.append(f"{folder}: {sorted(told - there)} were committed and are lost")
    if states - {"complete"} or there & spent:
        tally.wrong.append(f"{folder}: half a capture is taken for whole")
    happened = {
        "rolled forward": recovery.committed,
        "set aside": recovery.set_aside,
        "dropped": recovery.dropped,
    }
    names = [name for name, ids in happened.items() if ids]
    tally.outcomes[names[0] if names else "between captures"] += 1


def run(times: int, seed: int, root: Path) -> Tally:
    """Kill ``times`` children; the same seed draws the same instants."""
    draw = random.Random(seed)  # noqa: S311  instants, not secrets
    tally, told = Tally(), set[str]()
    first = 0
    for number in range(times):
        if number % FRESH_EVERY == 0:
            told = set()
            folder = root / f"session{number // FRESH_EVERY}"
        said = kill_one(folder, root / "locks", first, draw.uniform(0.0, LONGEST_S))
        told |= set(said)
        first += 1000
        tally.kills += 1
        tally.committed += len(said)
        look(folder, told, tally)
    return tally


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--times", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--folder", type=Path, default=None)
    args = parser.parse_args()
    root = Path(tempfile.mkdtemp(prefix="rigwright-crashes-", dir=args.folder))
    began = time.monotonic()
    try:
        tally = run(args.times, args.seed, root)
    finally:
        shutil.rmtree(root, ignore_errors=True)
    print(f"{tally.kills} kills in {time.monotonic() - began:.0f} s, seed {args.seed}")
    print(f"captures told as committed: {tally.committed}, all found whole afterwards")
    for name, count in sorted(tally.outcomes.items()):
        print(f"  killed: {name:36s} {count}")
    print(f"wrong: {len(tally.wrong)}")
    for line in tally.wrong:
        print(f"  {line}")
    sys.exit(1 if tally.wrong else 0)


if __name__ == "__main__":
    main()
