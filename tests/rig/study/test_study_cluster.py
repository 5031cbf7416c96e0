"""Studies on a Dask cluster of two processes: the bits of this one, whatever is killed."""

from __future__ import annotations

import logging
import os
import signal
from pathlib import Path

import pytest
from inline_studies import inline

from common.errors import DeviceError
from common.progress import NeverCancelled, Progress, ignore_progress
from rig.specification.rigfile import read_rig_file
from rig.study.cache import UnitCache
from rig.study.cluster import AT_ONCE, cluster
from rig.study.heads import heads_of
from rig.study.running import StudyRun
from rig.study.studyfile import Study
from rig.study.unit import Unit

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"


def units() -> list[Unit]:
    rig = read_rig_file(EXAMPLES / "studies/wall-rig.toml")
    return [
        Unit(
            rig=rig.model_copy(update={"seed": seed, "cameras": 3, "starts": 1}),
            heads=HEADS,
            designed_for=0,
        )
        for seed in range(1, 9)
    ]


HEADS, FILES = heads_of(Study(), ["wall"], {"head-1": EXAMPLES / "wall/targets.xyz"})


def test_a_scheduler_that_does_not_answer_is_told(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    study = StudyRun(units(), FILES, UnitCache(tmp_path), ignore_progress)
    with pytest.raises(DeviceError, match="no Dask scheduler answers at nonsense"):
        study.results(cluster("nonsense://nowhere"), AT_ONCE, NeverCancelled())


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # the cluster's own, when its processes are killed
def test_a_cluster_gives_the_bits_of_this_process_with_a_worker_killed(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    here = StudyRun(units(), FILES, UnitCache(tmp_path / "here"), ignore_progress)
    wanted = here.results(inline(), 1, NeverCancelled())
    killed: list[int] = []
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None,
        silence_logs=logging.CRITICAL,
    ) as local:  # fmt: skip

        def kill_one(progress: Progress) -> None:
            if progress.fraction > 0.0 and not killed:
                killed.append(next(iter(local.workers.values())).pid)
                os.kill(killed[0], signal.SIGKILL)

        there = StudyRun(units(), FILES, UnitCache(tmp_path / "there"), kill_one)
        found = there.results(cluster(local.scheduler_address), AT_ONCE, NeverCancelled())
    assert killed
    assert found == wanted
    kept = {p.name: p.read_bytes() for p in (tmp_path / "there").iterdir()}
    assert kept == {p.name: p.read_bytes() for p in (tmp_path / "here").iterdir()}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # the cluster's own, when its processes are killed
def test_a_scheduler_that_dies_costs_nothing_that_was_finished(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    local = distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=True, dashboard_address=None,
        silence_logs=logging.CRITICAL,
    )  # fmt: skip

    def close(progress: Progress) -> None:
        if progress.fraction > 0.0:
            local.close(timeout=20)

    study = StudyRun(units(), FILES, UnitCache(tmp_path), close)
    with pytest.raises(DeviceError, match="is gone"):
        study.results(cluster(local.scheduler_address), AT_ONCE, NeverCancelled())
    kept = len(list(tmp_path.glob("*.json")))
    assert kept >= 1
    again = StudyRun(units(), FILES, UnitCache(tmp_path), ignore_progress)
    assert all(r.reason == "" for r in again.results(inline(), 1, NeverCancelled()))
    assert again.reused == kept
