"""The documents and schemas say what the code does."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import jsonschema
import pytest
from plans import plate_plan

from rig.acquisition.station.stationfile import StationFile, parse_station
from rig.build.mounts.planfile import plan_document
from rig.catalogue.model import CatalogueFile
from rig.design.designfile import design_document
from rig.design.designmodel import DesignFile
from rig.specification.examples import example_rig, example_text
from rig.specification.rigfile import RigFile, parse_rig
from service.reference.schemas import documents, keys, main
from solver.result import Design


def test_generated_documents_are_up_to_date(repo: Path) -> None:
    for path, text in documents(repo / "docs" / "reference").items():
        assert path.read_text(encoding="utf-8") == text, f"run: make docs ({path.name})"


def test_the_command_writes_them(repo: Path, tmp_path: Path) -> None:
    for name in (path.name for path in documents(repo / "docs" / "reference")):
        text = (repo / "docs" / "reference" / name).read_text(encoding="utf-8")
        (tmp_path / name).write_text(text.replace("| `seed` |", "| `sead` |"), encoding="utf-8")
    main(tmp_path)
    for name in (path.name for path in documents(tmp_path)):
        assert (tmp_path / name).read_text() == (repo / "docs" / "reference" / name).read_text()


@pytest.mark.parametrize(
    ("document", "model"),
    [
        ("rig-file.md", RigFile),
        ("design-file.md", DesignFile),
        ("station-file.md", StationFile),
        ("catalogue.md", CatalogueFile),
    ],
)
def test_every_key_is_documented(repo: Path, document: str, model: type) -> None:
    text = (repo / "docs" / "reference" / document).read_text(encoding="utf-8")
    told = list(keys(model))
    assert len(told) > 50
    for key, _, words in told:
        assert f"| `{key}` |" in text
        assert words.endswith("."), f"{key} has no sentence"


def test_examples_follow_the_rig_schema(repo: Path) -> None:
    schema = json.loads((repo / "docs/reference/rig.schema.json").read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    for name in ("face", "wall"):
        data = tomllib.loads((repo / f"examples/{name}/rig.toml").read_text())
        jsonschema.validate(data, schema)
    with pytest.raises(jsonschema.ValidationError, match="base_hieght"):
        jsonschema.validate({**data, "limits": {"base_hieght": {}}}, schema)


def test_mounts_and_plans_follow_their_schemas(repo: Path) -> None:
    schema = json.loads((repo / "docs/reference/mount.schema.json").read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    for path in sorted((repo / "examples/mounts").glob("*.toml")):
        jsonschema.validate(tomllib.loads(path.read_text()), schema)
    with pytest.raises(jsonschema.ValidationError, match="t-slut"):
        jsonschema.validate({"kind": "t-slut"}, schema)
    schema = json.loads((repo / "docs/reference/plan.schema.json").read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    document = json.loads(json.dumps(plan_document(plate_plan()), allow_nan=False))
    jsonschema.validate(document, schema)
    with pytest.raises(jsonschema.ValidationError, match="mounts"):
        jsonschema.validate({k: v for k, v in document.items() if k != "mounts"}, schema)


def test_what_is_written_follows_the_design_schema(repo: Path, design: Design) -> None:
    schema = json.loads((repo / "docs/reference/design.schema.json").read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    document = json.loads(
        json.dumps(design_document(design, spec=example_rig("face")), allow_nan=False)
    )
    jsonschema.validate(document, schema)


def test_the_rig_file_in_the_document_is_a_rig_file(repo: Path) -> None:
    text = (repo / "docs/reference/rig-file.md").read_text(encoding="utf-8")
    first = text.split("```toml\n")[1].split("```")[0]
    assert parse_rig(first).count == 7
    parts = text.split("```toml\n")[2].split("```")[0]
    assert parse_rig(f'schema = "rigwright.rig/1"\n{parts}').camera.f_number == 16.0
    zones = text.split("```toml\n")[3].split("```")[0]
    # The zones of the document, put into the example in place of its own.
    before, _, after = example_text("face").partition("[limits.zones]")
    rest = after.partition("[limits.motion]")[2]
    read = parse_rig(f"{before}{zones}\n[limits.motion]{rest}").limits.zones
    assert (len(read.forbidden), len(read.allowed)) == (1, 1)


def test_the_station_file_in_the_document_is_a_station_file(repo: Path) -> None:
    text = (repo / "docs/reference/station-file.md").read_text(encoding="utf-8")
    station = parse_station(text.split("```toml\n")[1].split("```")[0])
    assert len(station.cameras) == 2 and station.trigger is not None


def test_the_example_station_follows_its_schema(repo: Path) -> None:
    schema = json.loads((repo / "docs/reference/station.schema.json").read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    data = tomllib.loads((repo / "examples/station/station.toml").read_text())
    jsonschema.validate(data, schema)
    with pytest.raises(jsonschema.ValidationError, match="camra"):
        jsonschema.validate({**data, "camra": []}, schema)
