"""Units side by side: what is kept, what is computed again, and what a death costs."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest
from inline_studies import inline

from common.errors import CancelledError
from common.progress import NeverCancelled, Progress, ignore_progress
from rig.specification.rigfile import RigFile, read_rig_file
from rig.specification.sections.limits import CoverageSection, TierSection
from rig.study.cache import UnitCache
from rig.study.heads import heads_of
from rig.study.running import StudyRun, processes
from rig.study.studyfile import Study
from rig.study.unit import Head, Unit, UnitResult

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
TARGETS = EXAMPLES / "wall/targets.xyz"


def wall(seed: int, cameras: int = 3) -> RigFile:
    rig = read_rig_file(EXAMPLES / "studies/wall-rig.toml")
    return rig.model_copy(update={"seed": seed, "cameras": cameras, "starts": 1})


HEADS, FILES = heads_of(Study(), ["wall"], {"head-1": TARGETS})


def units(*seeds: int) -> list[Unit]:
    return [Unit(rig=wall(seed), heads=HEADS, designed_for=0) for seed in seeds]


def run(
    cache: Path, asked: list[Unit], deadly: Callable[[Unit], bool] = lambda _: False
) -> tuple[list[UnitResult], int]:
    study = StudyRun(asked, FILES, UnitCache(cache), ignore_progress)
    return study.results(inline(deadly), 2, NeverCancelled()), study.reused


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[UnitResult]]:
    cache = tmp_path_factory.mktemp("units")
    return cache, run(cache, units(1, 2))[0]


def test_a_unit_holds_all_figures_of_its_rig(done: tuple[Path, list[UnitResult]]) -> None:
    first = done[1][0]
    assert first.reason == ""
    (figures,) = first.heads
    assert figures.violated == []
    assert figures.sigma_median_mm is not None
    assert 0.0 < figures.sigma_median_mm <= first.worst_p95_mm()
    assert [p.name for p in first.places] == ["cam01", "cam02", "cam03"]
    # The bodies reach beyond the projection centres, by no more than a body's length each way.
    across = [p.position_mm[0] for p in first.places]
    assert 0.0 < first.size_mm[0] - (max(across) - min(across)) < 2 * 250.0


def test_what_is_finished_is_not_computed_again(done: tuple[Path, list[UnitResult]]) -> None:
    cache, results = done
    killed = next(cache.glob(f"{results[1].key}*"))
    text = killed.read_bytes()
    killed.unlink()
    (cache / ".rigwright-0123456789abcdef").write_bytes(text[:20])  # what a kill leaves behind
    computed: list[str] = []

    def note(unit: Unit) -> bool:
        computed.append(unit.key())
        return False

    again, reused = run(cache, units(1, 2), note)
    assert (again, reused, computed) == (results, 1, [results[1].key])
    assert killed.read_bytes() == text
    assert len(list(cache.iterdir())) == 2


@pytest.mark.parametrize("text", [b"", b"{", b'{"schema": "rigwright.study-unit/1", "key": "x"}'])
def test_a_unit_that_cannot_be_read_is_none(tmp_path: Path, text: bytes) -> None:
    (tmp_path / "0ab1.json").write_bytes(text)
    assert UnitCache(tmp_path).get("0ab1") is None


def test_the_key_is_of_the_content_and_not_of_names() -> None:
    (one,) = units(1)
    renamed = [Head(name="another name", sha256=HEADS[0].sha256)]
    assert one.model_copy(update={"heads": renamed}).key() == one.key()
    others = [
        one.model_copy(update={"rig": wall(2)}),
        one.model_copy(update={"rig": wall(1, cameras=4)}),
        one.model_copy(update={"heads": [Head(name="wall", sha256="0" * 64)]}),
        one.model_copy(update={"heads": [*HEADS, Head(name="person 1", seed=1)]}),
    ]
    assert len({one.key(), *(unit.key() for unit in others)}) == 5


def test_a_deadly_unit_is_a_row_and_costs_no_other(
    done: tuple[Path, list[UnitResult]], tmp_path: Path
) -> None:
    found, _ = run(tmp_path / "units", units(3, 1), lambda unit: unit.rig.seed == 3)
    assert found[1:] == done[1][:1]
    assert "died, twice" in found[0].reason
    # It is no property of the rig: next time it is tried again.
    assert UnitCache(tmp_path / "units").get(found[0].key) is None


def test_a_worker_that_dies_once_costs_nothing_but_time(
    done: tuple[Path, list[UnitResult]], tmp_path: Path
) -> None:
    deaths = []

    def once(unit: Unit) -> bool:
        deaths.append(unit)
        return len(deaths) == 1

    assert run(tmp_path / "units", units(1), once)[0] == done[1][:1]


def test_a_unit_that_cannot_be_is_a_row_with_its_reason(tmp_path: Path) -> None:
    tier = [TierSection(views=9, share=1.0)]
    own = wall(1)
    limits = own.limits.model_copy(update={"coverage": CoverageSection(tier=tier)})
    rig = own.model_copy(update={"limits": limits})
    (found,), _ = run(tmp_path, [Unit(rig=rig, heads=HEADS, designed_for=0)])
    assert "9 views" in found.reason
    assert found.places == []


def test_the_same_unit_twice_is_computed_once(done: tuple[Path, list[UnitResult]]) -> None:
    told: list[Progress] = []
    study = StudyRun([*units(1, 2), *units(1)], FILES, UnitCache(done[0]), told.append)
    found = study.results(inline(), 1, NeverCancelled())
    assert found[0] == found[2]
    assert told[-1] == Progress("2 of 2 designs were finished before", 1.0)


def test_a_cancel_ends_a_study_and_keeps_what_was_finished(
    done: tuple[Path, list[UnitResult]], tmp_path: Path
) -> None:
    cancel = threading.Event()

    def stop_after_one(progress: Progress) -> None:
        if progress.fraction > 0.0:
            cancel.set()

    cache = tmp_path / "units"
    study = StudyRun(units(1, 2), FILES, UnitCache(cache), stop_after_one)
    with pytest.raises(CancelledError):
        study.results(inline(), 1, cancel)
    assert [p.stem for p in cache.iterdir()] == [done[1][0].key]


def test_a_rig_is_scored_on_every_head_wherever_its_file_has_its_origin(tmp_path: Path) -> None:
    lines = TARGETS.read_text(encoding="utf-8").splitlines()
    moved = tmp_path / "moved.xyz"
    with moved.open("w", encoding="utf-8") as file:
        for line in lines:
            if line.strip() and not line.startswith("#"):
                x, *rest = line.split()
                file.write(" ".join([str(float(x) + 64.0), *rest]) + "\n")
    heads, files = heads_of(Study(), ["wall", "moved"], {"head-1": TARGETS, "head-2": moved})
    unit = Unit(rig=wall(1), heads=heads, designed_for=1)
    study = StudyRun([unit], files, UnitCache(tmp_path / "units"), ignore_progress)
    (found,) = study.results(inline(), 1, NeverCancelled())
    one, other = found.heads
    assert (one.head, other.head) == ("wall", "moved")
    # The same targets: a shift by a power of two in metres changes the last digits only.
    assert one.sigma_p95_mm == pytest.approx(other.sigma_p95_mm, rel=1e-6)
    assert found.reason == ""


@pytest.mark.slow
def test_a_killed_worker_costs_no_more_than_the_units_under_way(
    done: tuple[Path, list[UnitResult]], tmp_path: Path
) -> None:
    """Two processes; the first that computes is killed by the system, as when memory is out."""
    victims: list[int] = []

    def kill_one(progress: Progress) -> None:
        if progress.fraction > 0.0 and not victims:
            worker = next(
                p
                for p in psutil.Process().children(recursive=True)
                if "spawn_main" in " ".join(p.cmdline())
            )
            victims.append(worker.pid)
            os.kill(worker.pid, signal.SIGKILL)

    asked = units(1, 2, 4, 5)
    study = StudyRun(asked, FILES, UnitCache(tmp_path / "units"), kill_one)
    found = study.results(processes(2), 2, NeverCancelled())
    assert victims
    # The same bits as computed here, whatever was killed.
    assert found[:2] == done[1]
    assert all(result.reason == "" for result in found)


@pytest.mark.slow
def test_a_cancel_stops_worker_processes_within_seconds(tmp_path: Path) -> None:
    cancel = threading.Event()
    rig = wall(1, cameras=8).model_copy(update={"starts": 500})
    unit = Unit(rig=rig, heads=HEADS, designed_for=0)
    study = StudyRun([unit], FILES, UnitCache(tmp_path), ignore_progress)
    threading.Timer(6.0, cancel.set).start()
    with pytest.raises(CancelledError):
        study.results(processes(1), 1, cancel)
    ended_s = time.monotonic()
    assert not [p for p in psutil.Process().children() if "spawn_main" in " ".join(p.cmdline())]
    assert time.monotonic() - ended_s < 1.0
