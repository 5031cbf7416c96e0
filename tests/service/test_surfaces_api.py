"""``/v1/reconstructions`` and ``/v1/comparisons``: the same work as the commands."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import trimesh
from evaluation_helpers import photographed, small_rig
from pydantic import ValidationError
from service_helpers import InThisProcess, TestClient, wait_for

from common.progress import CancelToken, ProgressCallback
from evaluation.reconstruction.cloudfile import read_points, write_distances
from rig.design.designfile import design_from_mapping, placed_camera
from rig.specification.examples import example_rig
from rig.specification.rigfile import RigFile
from service.api.app import create_app
from service.api.context import Service
from service.jobs.engine import Task
from service.kinds.base import RequestT, ResultT
from service.kinds.queued import QUEUED
from service.kinds.reconstruction import ReconstructionRequest
from service.settings import read_settings
from service.store.jobrecords import NewJob
from service.tasks.reconstructing import matching_options
from solver.matching import Matching

JSON = dict[str, Any]
pytest.importorskip("igl")
LIMIT_BYTES = 3 << 30


class Noting(InThisProcess):
    """Remembers how much memory each kind of task was allowed."""

    def __init__(self) -> None:
        self.allowed: dict[str, int | None] = {}

    def run(
        self, task: Task[RequestT, ResultT], report: ProgressCallback, cancel: CancelToken
    ) -> ResultT:
        self.allowed[task.kind.name] = task.kind.memory_limit_bytes
        return super().run(task, report, cancel)


def with_design(service: Service, folder: Path, design: JSON) -> str:
    """A design that is there already: making one is another test's matter."""
    path = folder / "design.json"
    path.write_text(json.dumps(design), encoding="utf-8")
    job = service.store.jobs.create(NewJob("design", {}), max_pending=9)
    service.store.jobs.claim_next()
    kept = {"design.json": (service.store.files.stage_existing(path), "application/json")}
    service.store.jobs.complete(job.id, {}, kept)
    return job.id


@pytest.fixture
def opened() -> Iterator[Callable[[Service], TestClient]]:
    clients: list[TestClient] = []

    def start(service: Service) -> TestClient:
        client = TestClient(create_app(service))
        clients.append(client)
        return client.__enter__()

    yield start
    for client in clients:
        client.__exit__(None, None, None)


@pytest.fixture
def engine() -> Noting:
    return Noting()


@pytest.fixture
def service(tmp_path: Path, engine: Noting) -> Iterator[Service]:
    settings = read_settings(data_dir=tmp_path / "data", surface_memory_limit_bytes=LIMIT_BYTES)
    made = Service(settings, QUEUED, engine)
    yield made
    made.close()


def ended(client: TestClient, path: str, body: JSON) -> JSON:
    """The job that was asked for, once it has ended."""
    asked = client.post(path, json=body)
    assert asked.status_code == 201, asked.text
    where = asked.headers["Location"]

    def look() -> JSON | None:
        job: JSON = client.get(where).json()
        return job if job["status"] not in ("pending", "running") else None

    return wait_for(look, 300.0)


def uploaded(client: TestClient, path: Path) -> str:
    answer = client.post(
        f"/v1/scans?filename={path.name}&units=mm&subject=object",
        content=path.read_bytes(),
        headers={"Content-Type": "application/octet-stream"},
    )
    assert answer.status_code == 201, answer.text
    return str(answer.json()["id"])


def archive(client: TestClient, pictures: dict[str, np.ndarray]) -> str:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as out:
        for camera, picture in pictures.items():
            out.writestr(f"{camera}/1.png", cv2.imencode(".png", picture)[1].tobytes())
    answer = client.post(
        "/v1/picture-sets", content=packed.getvalue(), headers={"Content-Type": "application/zip"}
    )
    assert answer.status_code == 201, answer.text
    return str(answer.json()["id"])


def test_a_cloud_is_compared_with_an_uploaded_surface(
    service: Service, engine: Noting, opened: Callable[[Service], TestClient], tmp_path: Path
) -> None:
    sphere = trimesh.creation.icosphere(3, 50.0)
    sphere.export(tmp_path / "ball.ply")
    outside = np.asarray(sphere.triangles_center) + 0.1 * np.asarray(sphere.face_normals)
    write_distances(tmp_path / "cloud.ply", outside, np.zeros(len(outside)))
    client = opened(service)
    body: JSON = {
        "cloud": {"scan_id": uploaded(client, tmp_path / "cloud.ply")},
        "reference_scan_id": uploaded(client, tmp_path / "ball.ply"),
    }
    job = ended(client, "/v1/comparisons", body)
    assert job["status"] == "completed", job["problem"]
    # Each point stands 0.1 mm before the middle of its face; files hold doubles.
    assert job["result"]["bias_mm"] == pytest.approx(0.1, abs=1e-6)
    assert engine.allowed["comparison"] == LIMIT_BYTES
    assert "rms 0.100 mm" in client.get(job["links"]["self"] + "/report").text
    (tmp_path / "back.ply").write_bytes(client.get(job["links"]["self"] + "/distances").content)
    assert len(read_points(tmp_path / "back.ply")) == job["result"]["points"] == len(outside)

    apart = body | {"within": {"centre_mm": [900.0, 0.0, 0.0], "radius_mm": 5.0}}
    failed = ended(client, "/v1/comparisons", apart)
    assert failed["problem"]["type"] == "/problems/input/compare-empty"
    for wrong in (
        body | {"cloud": {}},
        body | {"cloud": {"scan_id": "a", "reconstruction_id": "b"}},
        body | {"align": "fit"},
        body | {"limit": 3.0},
    ):
        assert client.post("/v1/comparisons", json=wrong).status_code == 422
    gone = client.post("/v1/comparisons", json=body | {"reference_scan_id": "none"})
    assert gone.status_code == 404


def test_pictures_of_no_known_camera_are_told(
    service: Service, engine: Noting, opened: Callable[[Service], TestClient], tmp_path: Path
) -> None:
    cameras = small_rig(example_rig("face").camera, np.zeros(3))
    document = {
        "schema": "rigwright.design/1",
        "cameras": [placed_camera(camera) for camera in cameras],
    }
    design = with_design(service, tmp_path, document)
    client = opened(service)
    picture = np.zeros((8, 8), np.uint8)
    pictures = {"picture_set_id": archive(client, {"left": picture, "cam01": picture})}
    body: JSON = {"pictures": pictures, "design_id": design}
    job = ended(client, "/v1/reconstructions", body)
    assert job["problem"]["type"] == "/problems/input/cameras-few"
    assert "cam01, left" in job["problem"]["detail"]
    assert engine.allowed["reconstruction"] == LIMIT_BYTES
    nowhere = client.post("/v1/reconstructions", json={"pictures": pictures})
    assert "give calibration_id, or design_id" in nowhere.json()["errors"][0]["message"]
    assert client.get("/v1/reconstructions").json()["items"][0]["id"] == job["id"]


def test_cameras_are_matched_as_the_design_counts_on() -> None:
    spec = example_rig("face")
    spec = replace(spec, limits=replace(spec.limits, matching=Matching(25.0, 60.0, 1.2)))
    document: JSON = {
        "schema": "rigwright.design/1",
        "cameras": [placed_camera(camera) for camera in small_rig(spec.camera, np.zeros(3))],
    }
    plain = design_from_mapping(document)
    told = design_from_mapping(
        document | {"rig": RigFile.from_spec(spec).model_dump(by_alias=True, exclude_none=True)}
    )
    assert matching_options(told, 3, 0) == replace(
        matching_options(None, 3, 1), farthest_deg=25.0, steepest_deg=60.0, largest_ratio=1.2
    )
    assert matching_options(plain, 3, 1) == matching_options(None, 3, 1)


def test_a_texture_needs_a_mesh_that_can_have_one() -> None:
    with pytest.raises(ValidationError, match="give glb or obj"):
        ReconstructionRequest(meshes=("ply",), texture=True)
    assert ReconstructionRequest(texture=True).meshes == ("ply", "glb")


@pytest.mark.slow
def test_the_head_is_reconstructed_and_compared_over_http(
    service: Service, opened: Callable[[Service], TestClient], tmp_path: Path
) -> None:
    pytest.importorskip("numba")
    taken = photographed(tmp_path / "taken")
    design = with_design(service, tmp_path, json.loads((taken / "design.json").read_text()))
    client = opened(service)
    pictures = {
        path.parent.name: cv2.imread(str(path), cv2.IMREAD_COLOR)
        for path in sorted((taken / "pictures").glob("*/1.png"))
    }
    body = {"pictures": {"picture_set_id": archive(client, pictures)}, "design_id": design}
    made = ended(client, "/v1/reconstructions", body | {"name": "Anna", "stride_px": 3})
    assert made["status"] == "completed", made["problem"]
    events = client.get(made["links"]["events"]).text
    assert "matching, full" in events
    (tmp_path / "cloud.ply").write_bytes(client.get(made["links"]["self"] + "/cloud").content)
    assert len(read_points(tmp_path / "cloud.ply")) == made["result"]["points"]
    assert "Anna" in client.get(made["links"]["self"] + "/report").text
    nose = json.loads((taken / "nose.json").read_text())
    asked = {
        "cloud": {"reconstruction_id": made["id"]},
        "reference_scan_id": uploaded(client, taken / "truth.ply"),
        "within": {"centre_mm": nose, "radius_mm": 60.0},
    }
    compared = ended(client, "/v1/comparisons", asked)
    assert compared["status"] == "completed", compared["problem"]
    # As of the same pictures by the command, see test_reconstruct_a_capture.py.
    assert compared["result"]["median_absolute_mm"] < 0.23
