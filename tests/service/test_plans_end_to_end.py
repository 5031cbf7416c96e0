"""From a head to a plan that can be built, over HTTP and on the command line."""

from __future__ import annotations

import io
import json
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from service_helpers import TestClient, files_under, rigwright, small_rig_text, wait_for

from geometry.head import synthetic_head
from rig.build.mounts.planfile import plan_from_mapping, read_plan
from rig.build.mounts.relaxing import MOST_LOSS
from rig.design.designfile import design_from_mapping
from service.api.app import create_app
from service.api.context import Service
from service.kinds.queued import QUEUED
from service.settings import read_settings
from service.tasks.designing import write_scan

JSON = dict[str, Any]
BEYOND_DEG = 3.0

pytestmark = pytest.mark.slow


def ended(client: TestClient, answer: Any) -> JSON:  # noqa: ANN401 - a response of the test client
    assert answer.status_code == 201, answer.text
    path = answer.headers["Location"]

    def look() -> JSON | None:
        job: JSON = client.get(path).json()
        return job if job["ended_at"] else None

    return wait_for(look, 240.0)


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    settings = read_settings(data_dir=tmp_path_factory.mktemp("data"), workers_per_job=1)
    service = Service(settings, QUEUED)
    with TestClient(create_app(service)) as opened:
        yield opened
    service.close()


@pytest.fixture(scope="module")
def head(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("head") / "head.ply"
    write_scan(synthetic_head(), path)
    return path


@pytest.fixture(scope="module")
def design(client: TestClient, head: Path) -> JSON:
    scan = client.post("/v1/scans?filename=head.ply", content=head.read_bytes()).json()
    rig = tomllib.loads(small_rig_text())
    job = ended(client, client.post("/v1/designs", json={"scan_id": scan["id"], "rig": rig}))
    assert job["status"] == "completed", job["problem"]
    return job


@pytest.fixture(scope="module")
def plan(client: TestClient, design: JSON) -> JSON:
    request = {"design_id": design["id"], "mount": {"kind": "t-slot"}, "name": "small"}
    job = ended(client, client.post("/v1/plans", json=request))
    assert job["status"] == "completed", job["problem"]
    return job


def test_a_plan_says_what_it_costs_and_how_it_is_set(plan: JSON, design: JSON) -> None:
    result = plan["result"]
    assert result["buildable"]
    assert result["clashes"] == []
    designed, built = result["price"]["designed"], result["price"]["built"]
    loss = built["sigma_median_mm"] / designed["sigma_median_mm"] - 1.0
    assert result["price"]["sigma_loss"] == pytest.approx(loss)
    # Room for settings may cost 3.5 %, and as much again where cameras that came to see what they
    # did not are moved anew: without that this rig breaks six limits, at a loss of 1.2 %.
    assert loss < 2.0 * MOST_LOSS
    assert len(result["cameras"]) == design["result"]["cameras"]
    for camera in result["cameras"]:
        assert {"height", "pan", "tilt", "roll"} <= {s["name"] for s in camera["settings"]}
        for setting in camera["settings"]:
            if setting["step"]:
                steps = setting["value"] / setting["step"]
                assert steps == pytest.approx(round(steps), abs=1e-6)
    assert result["steps"]


def test_its_files_are_those_of_a_plan_folder(client: TestClient, plan: JSON, design: JSON) -> None:
    own = plan["links"]["self"]
    names = {f["name"] for f in client.get(f"{own}/files").json()["items"]}
    assert {"plan.json", "plan.html", "parts/bill.csv", "drawings/views.dxf"} <= names
    assert client.get(f"{own}/report").text.startswith("<!")
    assert client.get(f"{own}/files/drawings/views.pdf").content.startswith(b"%PDF")
    made = plan_from_mapping(client.get(f"{own}/plan").json())
    wanted = design_from_mapping(client.get(f"{design['links']['self']}/design").json()).cameras
    for mount, camera in zip(made.mounts, wanted, strict=True):
        turn = mount.camera.pose.axis_rig @ camera.pose.axis_rig
        assert np.degrees(np.arccos(np.clip(turn, -1.0, 1.0))) < BEYOND_DEG
    packed = client.get(f"{own}/archive").content
    with zipfile.ZipFile(io.BytesIO(packed)) as archive:
        assert set(archive.namelist()) == names
        assert archive.testzip() is None


def test_the_same_on_the_command_line(
    client: TestClient, design: JSON, plan: JSON, head: Path, tmp_path: Path
) -> None:
    document = client.get(f"{design['links']['self']}/design").json()
    (tmp_path / "rig").mkdir()
    (tmp_path / "rig" / "design.json").write_text(json.dumps(document))
    mount = tmp_path / "t-slot.toml"
    mount.write_text('kind = "t-slot"\n')
    asked = ("plan", tmp_path / "rig" / "design.json", "--mount", mount, "--out", tmp_path / "plan")
    lacking = rigwright(*asked)
    assert (lacking.returncode, lacking.stderr.count("\n")) == (2, 1)
    assert "is not beside it; give --scan" in lacking.stderr
    assert not (tmp_path / "plan").exists()
    # Beside the design, under the name that the design gives it, the scan is found.
    (tmp_path / "rig" / document["scan"]["name"]).write_bytes(head.read_bytes())
    done = rigwright(*asked, "--name", "small")
    assert done.returncode == 0, done.stderr
    assert "What building costs" in done.stdout
    served = plan_from_mapping(client.get(f"{plan['links']['self']}/plan").json())
    made = read_plan(tmp_path / "plan" / "plan.json")
    assert [m.values() for m in made.mounts] == [m.values() for m in served.mounts]
    assert len(files_under(tmp_path / "plan")) > 20
    again = rigwright(*asked)
    assert again.returncode == 2
    assert "not empty" in again.stderr
