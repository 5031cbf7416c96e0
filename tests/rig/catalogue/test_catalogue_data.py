"""The data that comes with the program: enough of it, each figure with a source, none absurd."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from common.errors import InputError
from rig.catalogue import Catalogue, CatalogueCamera, fit, load_catalogue
from rig.catalogue.model import ENTRIES

REPO = Path(__file__).resolve().parents[3]
DATA = REPO / "rig/catalogue/data"


@pytest.fixture(scope="module")
def catalogue() -> Catalogue:
    return load_catalogue()


def test_there_are_enough_parts_of_every_kind(catalogue: Catalogue) -> None:
    assert len(catalogue.cameras) >= 25
    assert len(catalogue.lenses) >= 25
    kinds = [camera.kind for camera in catalogue.cameras.values()]
    needed = {"machine-vision": 10, "dslr": 4, "mirrorless": 6, "board": 3, "action": 2}
    for kind, least in needed.items():
        assert kinds.count(kind) >= least, kind
    makers = {camera.maker for camera in catalogue.cameras.values()}
    assert makers >= {
        *("Basler", "Teledyne FLIR", "IDS", "Allied Vision", "Daheng Imaging"),
        *("Canon", "Nikon", "Sony", "Panasonic", "Raspberry Pi", "GoPro"),
    }
    assert {lens.mount for lens in catalogue.lenses.values()} >= {
        *("C", "CS", "M12", "EF", "EF-S", "RF", "F", "Z", "E", "L", "MFT"),
    }
    assert {profile.series for profile in catalogue.profiles.values()} == {
        *("2020", "2040", "3030", "4040", "1515"),
    }
    assert {head.kind for head in catalogue.heads.values()} >= {"ball", "geared"}
    assert catalogue.brackets and catalogue.fasteners


def test_every_figure_has_a_source(catalogue: Catalogue) -> None:
    for table, part in catalogue.parts():
        named = set(ENTRIES[table].model_fields) - {"name", "maker", "kind", "note", "source"}
        for key in named:
            value = getattr(part, key)
            if value is not None and value != ():
                assert part.sources[key].title, f"{part.id}.{key}"
            else:
                assert key not in part.sources, f"{part.id}.{key} has a source but no figure"


def test_sources_name_no_host() -> None:
    for path in DATA.glob("*.toml"):
        text = path.read_text(encoding="utf-8")
        assert "://" not in text and not re.search(r"\bwww\.", text)


def test_the_document_counts_right(catalogue: Catalogue) -> None:
    text = (REPO / "docs/reference/catalogue.md").read_text(encoding="utf-8")
    assert f"{len(catalogue.cameras)} cameras and {len(catalogue.lenses)} lenses" in text


def test_sensors_are_of_the_size_their_pixels_make(catalogue: Catalogue) -> None:
    """Pitch and image size, or sensor size and image size, agree with square pixels."""
    for camera in catalogue.cameras.values():
        if camera.sensor_size_mm is not None:
            # Published sizes are rounded to 0.1 mm, and some name pixels that are not used.
            width, height = camera.sensor_size_mm
            across, down = camera.image_size_px
            assert width / across == pytest.approx(height / down, rel=0.015), camera.id
        if camera.pitch_um is not None:
            assert 1.0 < camera.pitch_um < 10.0
            assert 4.0 < camera.diagonal_mm < 45.0, camera.id


def test_basler_diagonals_are_those_of_their_sheets(catalogue: Catalogue) -> None:
    # The sheets state the diagonal too: an independent figure.
    for part_id, diagonal in {
        "basler-a2a5328-22g5m": 19.3,
        "basler-a2a5320-29mg": 16.8,
        "basler-a2a4200-12gc": 11.81,
        "basler-aca4024-8g": 9.33,
        "basler-aca2040-55u": 8.9,
        "basler-aca1440-220u": 6.3,
        "basler-aca2500-14u": 7.2,
        "basler-daa2448-70u": 8.8,
        "basler-aca4112-30u": 17.6,
    }.items():
        assert catalogue.cameras[part_id].diagonal_mm == pytest.approx(diagonal, abs=0.1)


def test_raspberry_pi_views_are_those_of_the_sheet(catalogue: Catalogue) -> None:
    # Horizontal fields of view as published: another independent check of pitch and focal length.
    for part_id, view_deg in {
        "rpi-camera-1": 53.5,
        "rpi-camera-2": 62.2,
        "rpi-camera-3": 66.0,
        "rpi-ai": 66.0,
    }.items():
        camera = catalogue.cameras[part_id]
        lens = catalogue.lenses[camera.fixed_lens]
        width = camera.active_size_mm[0]
        view = 2.0 * np.degrees(np.arctan(width / (2.0 * lens.focal_length_mm)))
        assert view == pytest.approx(view_deg, abs=3.0), part_id


def test_the_derived_entrance_pupil() -> None:
    """Paraxial trace of WO 2019/220618, example 9: image of the stop through the front group."""
    # Radius, distance to the next surface, index behind it; the stop follows.
    front = (
        *((-48.06, 2.0, 1.673), (50.03, 2.861, 1.946), (105.0, 2.805, 1.0)),
        *((-226.3, 6.827, 1.729), (-47.98, 0.644, 1.0), (36.65, 0.1, 1.561)),
        *((36.86, 5.622, 1.804), (217.9, 0.2, 1.0), (28.49, 7.332, 1.593)),
        *((-161.4, 1.5, 1.648), (20.99, 5.164, 1.0)),
    )
    # From the stop backwards: an object at distance t in a medium n, seen through each surface.
    place, index = 0.0, 1.0
    for (radius, gap, behind), before in zip(
        front[::-1], [*[n for _, _, n in front[-2::-1]], 1.0], strict=True
    ):
        assert behind == index
        reach = gap + place
        # n'/s' = n/s + (n' - n)/R, light running backwards; s counts from the surface.
        place = before / (index / reach - (index - before) / radius)
        index = before
    length = 92.31
    # First surface to image 92.31 mm; the flange of the Z mount lies 16 mm before the image.
    pupil = load_catalogue().lenses["nikkor-z-50-f18-s"].entrance_pupil_mm
    assert length - place - 16.0 == pytest.approx(pupil, abs=0.5)


def test_the_1515_profile_bends_as_its_catalogue_says() -> None:
    # 80/20 catalogue 21: 30 inches, 50 pounds in the middle of two supports, .011 inches.
    profile = load_catalogue().profiles["1515"]
    length_mm, load_n = 30 * 25.4, 50 * 4.4482
    stiffness = 48.0 * profile.elasticity_n_per_mm2 * profile.inertia_x_mm4
    # The example is rounded to a thousandth of an inch: 5 per cent.
    assert load_n * length_mm**3 / stiffness == pytest.approx(0.011 * 25.4, rel=0.05)


def test_every_camera_takes_a_lens_or_says_what_is_missing(catalogue: Catalogue) -> None:
    def takes(camera: CatalogueCamera) -> list[str]:
        found = []
        for lens in catalogue.lenses.values():
            try:
                fit(catalogue, camera, lens)
            except InputError as error:
                assert "\n" not in str(error)
            else:
                found.append(lens.id)
        return found

    alone = [camera.id for camera in catalogue.cameras.values() if not takes(camera)]
    assert alone == ["gopro-hero12", "dji-osmo-action-4"], "their makers publish no focal length"


def test_adapters_are_as_thick_as_the_flanges_differ(catalogue: Catalogue) -> None:
    cameras, lenses = catalogue.cameras, catalogue.lenses
    ring = fit(catalogue, cameras["rpi-hq"], lenses["kowa-lm25hc"])
    assert ring.adapter_mm == pytest.approx(5.0)
    assert "C-CS" in ring.adapter
    old = fit(catalogue, cameras["canon-eos-r6-ii"], lenses["canon-ef-100-f28l-macro"])
    assert old.adapter_mm == pytest.approx(24.0)
    nikon = fit(catalogue, cameras["nikon-z7-ii"], lenses["nikon-af-s-50-f18g"])
    assert nikon.adapter_mm == pytest.approx(30.5)
    direct = fit(catalogue, cameras["canon-eos-250d"], lenses["canon-ef-50-f18-stm"])
    assert (direct.adapter, direct.adapter_mm) == ("", 0.0)
