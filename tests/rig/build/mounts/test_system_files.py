"""System files: what a person writes, and what is said about mistakes in it."""

from __future__ import annotations

from pathlib import Path

import pytest

from common.errors import InputError, NotFoundError, RigwrightError
from rig.build.mounts.systemfile import SystemFile, parse_system, read_system
from rig.build.mounts.systems.arc import ArcSystem
from rig.build.mounts.systems.plate import PlateSystem
from rig.build.mounts.systems.tripods import TripodSystem
from rig.build.mounts.systems.tslot import TSlotSystem
from service.reference.schemas import key_table

ROOT = Path(__file__).resolve().parents[4]
KINDS = {"t-slot": TSlotSystem, "plate": PlateSystem, "arc": ArcSystem, "tripods": TripodSystem}


@pytest.mark.parametrize("kind", KINDS)
def test_the_kind_alone_is_enough(kind: str) -> None:
    spec = parse_system(f'kind = "{kind}"')
    assert isinstance(spec.system, KINDS[kind])
    assert spec.name == kind
    assert spec.system.kind == kind


@pytest.mark.parametrize("kind", KINDS)
def test_the_examples_are_read(kind: str) -> None:
    spec = read_system(ROOT / "examples" / "mounts" / f"{kind}.toml")
    assert spec.system.kind == kind


def test_the_page_lists_every_key() -> None:
    page = ROOT / "docs" / "reference" / "mounts.md"
    assert key_table(SystemFile) in page.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('kind = "t-slut"', "kind"),
        ('kind = "t-slot"\nprofil = "2020"', "did you mean profile"),
        ('kind = "t-slot"\nprofile = "2021"', "did you mean 2020"),
        ('kind = "t-slot"\nhead = "manfroto-410"', "did you mean manfrotto-410"),
        ('kind = "plate"\nprofile = "2020"', "choose 2040"),
        ('kind = "tripods"\nstand = "tripod-1900"', "did you mean tripod-1800"),
        ('kind = "arc"\nspare = -1.0', "spare"),
        ('kind = "arc"\n[[zone]]\nlow_mm = [0.0, 0.0, 0.0]\nhigh_mm = [0.0, 1.0, 1.0]', "below"),
        ("kind =", "TOML"),
    ],
)
def test_a_mistake_is_told_in_one_line(text: str, said: str) -> None:
    with pytest.raises(RigwrightError) as raised:
        parse_system(text, "mount.toml")
    assert isinstance(raised.value, InputError | NotFoundError)
    assert said in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot read the system file"):
        read_system(tmp_path / "none.toml")
