"""Where filed pictures show targets, and target files as they are, over HTTP."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from plate_pictures import practice_in, put_plate
from service_helpers import TestClient, running, wait_for
from stations import write_station

JSON = dict[str, Any]


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[TestClient, JSON, str]]:
    """A service with a capture of a plate, upper left in one camera and nowhere in the other."""
    folder = tmp_path_factory.mktemp("fields")
    practice = practice_in(folder)
    with running(folder / "data", write_station(folder / "in")) as client:
        made = client.post(
            "/v1/rigs/studio/captures", json={"capture_id": "one", "session": "anna"}
        )
        own = made.headers["Location"]
        record = wait_for(lambda: client.get(own).json()["result"])["record"]
        put_plate(practice, folder / "data/sessions/anna", record)
        text = (practice / "targets.toml").read_text()
        given = client.post("/v1/target-files", json={"name": "targets.toml", "text": text})
        assert given.status_code == 201, given.text
        yield client, record, given.json()["id"]


def test_the_field_is_told_by_its_cells(lab: tuple[TestClient, JSON, str]) -> None:
    client, record, targets = lab
    seen = [
        client.get(
            f"/v1/sessions/anna/fields/{frame['file']['path']}", params={"target_set_id": targets}
        ).json()
        for frame in record["frames"]
    ]
    assert [one["camera"] for one in seen] == [frame["camera"] for frame in record["frames"]]
    shown, empty = seen
    assert shown["targets"] > 20
    # 490 of 1000 pixels down are cells 0 to 2 of five.
    assert {0, 1} <= {row for _, row in shown["cells"]} <= {0, 1, 2}
    assert (4, 4) not in map(tuple, shown["cells"])
    assert (empty["targets"], empty["cells"]) == (0, [])


def test_what_is_no_picture_or_no_target_set_is_told(lab: tuple[TestClient, JSON, str]) -> None:
    client, record, targets = lab
    path = record["frames"][0]["file"]["path"]
    for wrong, given in (("session.json", targets), (path, "none")):
        answer = client.get(f"/v1/sessions/anna/fields/{wrong}", params={"target_set_id": given})
        assert answer.status_code == 404


def test_a_target_file_is_the_target_set_it_says(lab: tuple[TestClient, JSON, str]) -> None:
    client, _, targets = lab
    text = client.get(f"/v1/target-sets/{targets}/file").text
    again = client.post("/v1/target-files", json={"name": "other.toml", "text": text})
    assert (again.status_code, again.json()["id"]) == (200, targets)
    wrong = client.post("/v1/target-files", json={"name": "bad.toml", "text": "schema = ["})
    assert wrong.status_code == 422
    assert "bad.toml" in wrong.json()["detail"]
