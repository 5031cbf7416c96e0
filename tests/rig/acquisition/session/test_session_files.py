"""What stands in a session: proved whole, and readable by the programs that take it on."""

from __future__ import annotations

import errno
import json
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone
from io import BytesIO
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from memorybench import Bench, BenchMaker
from memoryrig import CameraScript, memory_station
from PIL import Image
from PIL.ExifTags import IFD, Base

from common.errors import ConflictError, InputError
from rig.acquisition.cameras.base import Frame, FrameStatus
from rig.acquisition.session import paths
from rig.acquisition.session.exif import PictureFacts, with_exif
from rig.acquisition.session.folder import session_folder
from rig.acquisition.session.pictures import filed
from rig.acquisition.session.staging import Stage
from rig.acquisition.session.storage import disk_errors
from rig.acquisition.session.tables import tables
from rig.acquisition.session.verify import SessionFindingKind, verify_session
from rig.acquisition.station.spec import CapturePolicy, ImageFormat
from rig.acquisition.synchrony.faults import HARMLESS, FaultKind
from rig.design.designfile import design_document
from solver.result import Design

FACTS = PictureFacts(
    unique_id="smile/cam01/1",
    taken_at=datetime(2026, 11, 22, 9, 5, 7, 123456, timezone(timedelta(hours=-3))),
    make="Memory",
    model="M1",
    serial_number="SN01",
    exposure_us=4000.0,
    f_number=11.0,
    iso=100,
    focal_length_mm=50.0,
)
COLOUR = np.random.default_rng(1).integers(0, 256, (48, 64, 3), np.uint8)


def frame(pixels: np.ndarray) -> Frame:
    return Frame("SN01", 0, FrameStatus.OK, pixels=pixels)


def exif(data: bytes) -> dict[int, object]:
    tags = Image.open(BytesIO(data)).getexif()
    return {**tags, **tags.get_ifd(IFD.Exif)}


DEEP = COLOUR.astype(np.uint16) * 257


@pytest.mark.parametrize("form", list(ImageFormat))
@pytest.mark.parametrize(
    "pixels",
    [COLOUR, COLOUR[:, :, 0], DEEP, DEEP[:, :, 0]],
    ids=["rgb8", "grey8", "rgb16", "grey16"],
)
def test_every_kind_of_picture_in_every_format(form: ImageFormat, pixels: np.ndarray) -> None:
    import cv2

    file = filed(frame(pixels), FACTS, CapturePolicy(image_format=form))
    tags = exif(file.data)
    assert tags[Base.Make] == "Memory" and tags[Base.Model] == "M1"
    assert tags[Base.BodySerialNumber] == "SN01"
    assert tags[Base.DateTimeOriginal] == "2026:11:22 09:05:07"
    assert tags[Base.SubsecTimeOriginal] == "123456"
    assert tags[Base.OffsetTimeOriginal] == "-03:00"
    assert float(tags[Base.ExposureTime]) == pytest.approx(0.004)
    assert float(tags[Base.FNumber]) == 11.0
    assert float(tags[Base.FocalLength]) == 50.0
    assert tags[Base.ISOSpeedRatings] == 100
    assert tags[Base.ImageUniqueID] == "smile/cam01/1"
    back = cv2.imdecode(np.frombuffer(file.data, np.uint8), cv2.IMREAD_UNCHANGED)
    assert back is not None and back.dtype == pixels.dtype
    back = back[:, :, ::-1] if back.ndim == 3 else back
    if file.media_type == "image/jpeg":
        # White noise is the worst case of JPEG; at quality 95 its errors stay below a tenth.
        assert np.abs(back.astype(int) - pixels).max() < 26
    else:
        assert np.array_equal(back, pixels)
    assert file.as_png == (pixels.dtype == np.uint16 and file.suffix == ".png" and form != "png")


def test_a_cameras_own_file_keeps_its_picture_and_its_tags() -> None:
    buffer = BytesIO()
    own = Image.Exif()
    own[Base.Make] = "Maker"
    Image.fromarray(COLOUR).save(buffer, "JPEG", exif=own)
    plain = buffer.getvalue()
    file = filed(
        replace(frame(COLOUR), pixels=None, encoded=plain, media_type="image/jpeg"),
        FACTS,
        CapturePolicy(image_format=ImageFormat.PNG),
    )
    tags = exif(file.data)
    assert file.suffix == ".jpg", "a camera's file stays what it is"
    assert tags[Base.Make] == "Maker" and tags[Base.BodySerialNumber] == "SN01"
    # Behind the tables everything is as it was: not one pixel was coded again.
    assert file.data[file.data.index(b"\xff\xdb") :] == plain[plain.index(b"\xff\xdb") :]
    again = with_exif(file.data, replace(FACTS, unique_id="other"))
    assert exif(again)[Base.ImageUniqueID] == "smile/cam01/1"


def test_files_that_must_not_be_touched_are_not() -> None:
    buffer = BytesIO()
    own = Image.Exif()
    own.get_ifd(IFD.Exif)[Base.MakerNote] = b"offsets into this block"
    Image.fromarray(COLOUR).save(buffer, "JPEG", exif=own)
    for data in (buffer.getvalue(), b"\xff\xd8 cut off", b"no picture at all", b""):
        assert with_exif(data, FACTS) == data


def test_raw_files_get_a_suffix_by_their_kind() -> None:
    for media_type, suffix in (
        ("image/x-nikon-nef", ".nef"),
        ("image/x-canon-cr3", ".cr3"),
        ("image/x-adobe-dng", ".dng"),
        ("image/tiff", ".tif"),
    ):
        one = replace(frame(COLOUR), pixels=None, encoded=b"raw", media_type=media_type)
        assert filed(one, FACTS, CapturePolicy()).suffix == suffix
    with pytest.raises(InputError, match="holds no picture"):
        filed(replace(frame(COLOUR), pixels=None), FACTS, CapturePolicy())


@pytest.fixture
def shot(bench: BenchMaker) -> Bench:
    made = bench()
    made.rig.capture(made.session, "one", shots=2, interval_us=20_000.0)
    made.rig.capture(made.session, "two")
    return made


def spoil(folder: Path, path: str, change: Callable[[bytes], bytes]) -> None:
    (folder / path).write_bytes(change((folder / path).read_bytes()))


def test_a_whole_session_is_whole_wherever_it_is_copied(shot: Bench, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(shot.session.folder, copy)
    check = verify_session(copy)
    assert check.whole and check.captures == 2
    # 9 pictures, 2 records, 3 tables, rig.json and session.json.
    assert check.files == 16
    listed = sum(path.stat().st_size for path in copy.rglob("*") if path.is_file())
    assert check.bytes == listed - (copy / "session.json").stat().st_size


def test_everything_that_can_happen_to_a_copy_is_found(shot: Bench, tmp_path: Path) -> None:
    picture, kind = "images/rig1/cam02/000002.jpg", SessionFindingKind

    def flip(data: bytes) -> bytes:
        return data[:-1] + bytes([data[-1] ^ 1])

    harm: list[tuple[str, Callable[[Path], object], SessionFindingKind, str]] = [
        ("bit", lambda f: spoil(f, picture, flip), kind.CHANGED, picture),
        ("cut", lambda f: spoil(f, picture, lambda d: d[:-9]), kind.CHANGED, picture),
        ("gone", lambda f: (f / picture).unlink(), kind.MISSING, picture),
        ("table", lambda f: (f / "frames.csv").unlink(), kind.MISSING, "frames.csv"),
        ("log", lambda f: spoil(f, "trigger.jsonl", flip), kind.CHANGED, "trigger.jsonl"),
        ("rig", lambda f: spoil(f, "rig/rig.json", flip), kind.CHANGED, "rig/rig.json"),
        ("extra", lambda f: (f / "images/x.jpg").write_bytes(b""), kind.EXTRA, "images/x.jpg"),
        ("stage", lambda f: stage(f), kind.INTERRUPTED, ".incomplete/three/a.jpg"),
        (
            "record",
            lambda f: spoil(f, "captures/000002-two.json", flip),
            kind.DAMAGED,
            "session.json",
        ),
        ("manifest", lambda f: spoil(f, "session.json", flip), kind.DAMAGED, "session.json"),
        ("link", lambda f: link(f, picture), kind.MISSING, picture),
    ]
    for name, do, found, path in harm:
        copy = tmp_path / name
        shutil.copytree(shot.session.folder, copy)
        do(copy)
        findings = verify_session(copy).findings
        assert [(f.kind, f.path) for f in findings] == [(found, path)], name
    assert verify_session(shot.session.folder).whole


def stage(folder: Path) -> None:
    (folder / ".incomplete/three").mkdir(parents=True)
    (folder / ".incomplete/three/a.jpg").write_bytes(b"half")


def link(folder: Path, picture: str) -> None:
    """The same bytes from elsewhere are not a copy that can be carried away."""
    elsewhere = folder.with_name("elsewhere.jpg")
    (folder / picture).rename(elsewhere)
    (folder / picture).symlink_to(elsewhere)


def test_two_captures_swapped_by_hand_contradict_the_manifest(shot: Bench) -> None:
    """Even with every checksum made right again."""
    from rig.acquisition.session.jsonfiles import model_bytes, read_model, signed
    from rig.acquisition.session.records import SessionFile

    shot.session.close()
    path = shot.session.folder / "session.json"
    manifest = read_model(SessionFile, path.read_bytes(), "session.json")
    one, two = manifest.captures
    swapped = [one.model_copy(update={"record": two.record}), two]
    path.write_bytes(model_bytes(signed(manifest.model_copy(update={"captures": swapped}))))
    kinds = {finding.kind for finding in verify_session(shot.session.folder).findings}
    assert SessionFindingKind.CONTRADICTION in kinds


def test_a_manifest_cannot_point_out_of_its_folder(shot: Bench) -> None:
    shot.session.close()
    path = shot.session.folder / "session.json"
    document = json.loads(path.read_text())
    for evil in ("../secret", "/etc/passwd", "a\\..\\b"):
        document["rig"][0]["path"] = evil
        path.write_text(json.dumps(document))
        (finding,) = verify_session(shot.session.folder).findings
        assert finding.kind is SessionFindingKind.DAMAGED
        assert "rig[0].path" in finding.text


def test_tables_are_made_of_the_records_alone(shot: Bench) -> None:
    made = tables(shot.session.index.records)
    for path, data in made.items():
        assert (shot.session.folder / path).read_bytes() == data


def test_pictures_carry_their_own_serial_number(shot: Bench) -> None:
    """Without it Meshroom takes seven cameras for one."""
    serials = set()
    for camera in ("cam01", "cam02", "cam03"):
        path = shot.session.folder / f"images/rig1/{camera}/000001.jpg"
        tags = exif(path.read_bytes())
        serials.add(tags[Base.BodySerialNumber])
        assert tags[Base.ImageUniqueID] == f"one/{camera}/1"
        assert tags[Base.Make] == "Memory"
    assert serials == {"SN01", "SN02", "SN03"}


def test_burst_pictures_are_dated_by_their_own_instant(shot: Bench) -> None:
    record = shot.session.index.records[0]
    stamps = []
    for instant in (1, 2):
        path = shot.session.folder / f"images/rig1/cam01/{instant:06d}.jpg"
        tags = exif(path.read_bytes())
        text = f"{tags[Base.DateTimeOriginal]}.{tags[Base.SubsecTimeOriginal]}"
        stamps.append(datetime.strptime(text, "%Y:%m:%d %H:%M:%S.%f").replace(tzinfo=UTC))
    # 20 ms apart, and microseconds of rounding.
    assert (stamps[1] - stamps[0]).total_seconds() == pytest.approx(0.02, abs=1e-4)
    assert abs(datetime.fromisoformat(record.fired_at) - datetime.now(UTC)) < timedelta(minutes=5)


def test_a_subjects_letters_are_kept() -> None:
    now = datetime(2026, 11, 29, 12, tzinfo=UTC)
    for subject, name in (
        ("Anna Müller", "sub-AnnaMüller"),
        ("Mu\u0308ller", "sub-Müller"),
        ("李雷 2", "sub-李雷2"),
        ("../..", "sub-unnamed"),
    ):
        assert session_folder(Path("root"), subject, now).parent == Path("root") / name


def test_files_follow_their_schemas(shot: Bench) -> None:
    docs = Path(__file__).resolve().parents[4] / "docs/reference"
    folder = shot.session.folder
    for name, files in (
        ("session.schema.json", [folder / "session.json"]),
        ("capture.schema.json", sorted((folder / "captures").iterdir())),
    ):
        schema = json.loads((docs / name).read_text())
        jsonschema.Draft202012Validator.check_schema(schema)
        assert files
        for path in files:
            jsonschema.validate(json.loads(path.read_text()), schema)
        with pytest.raises(jsonschema.ValidationError, match="sujbect"):
            jsonschema.validate({**json.loads(files[0].read_text()), "sujbect": 1}, schema)


@pytest.fixture
def small(design: Design) -> Design:
    """The design with cameras of the same view and a twentieth of the pixels each way."""
    cameras = []
    for placed in design.cameras:
        camera = replace(
            placed.camera,
            image_size_px=(200, 134),
            pixel_pitch_mm=placed.camera.pixel_pitch_mm * 20.0,
            principal_point_px=np.array([99.2, 67.1]),
            distortion=np.array([-0.12, 0.05, 0.001, -0.002, 0.01]),
        )
        cameras.append(replace(placed, camera=camera))
    return replace(design, cameras=tuple(cameras))


@pytest.fixture
def designed(bench: BenchMaker, small: Design, tmp_path: Path) -> Bench:
    """A session whose poses and calibration come from a design."""
    design, path = small, tmp_path / "design.json"
    path.write_text(json.dumps(design_document(design)))
    station = memory_station(len(design.cameras), design=path)
    names = [camera.name for camera in design.cameras]
    assert names == [camera.name for camera in station.cameras]
    width, height = design.cameras[0].camera.image_size_px
    sized = {name: CameraScript(size_px=(width, height)) for name in names}
    made = bench(station, sized)
    made.rig.capture(made.session, "one")
    made.rig.capture(made.session, "two")
    return made


@pytest.mark.slow
def test_a_design_travels_with_its_session(designed: Bench, small: Design) -> None:
    design = small
    folder = designed.session.folder
    assert (folder / "rig/design.json").read_bytes() == (folder.parent / "design.json").read_bytes()
    calibration = json.loads((folder / "rig/calibration.json").read_text())
    assert [c["name"] for c in calibration["cameras"]] == [c.name for c in design.cameras]
    assert (
        calibration["cameras"][0]["camera_matrix"]
        == design.cameras[0].camera.camera_matrix.tolist()
    )
    assert all(r.state == "complete" for r in designed.session.index.records)
    assert verify_session(folder).whole


def test_a_design_says_how_large_pictures_are(
    bench: BenchMaker, design: Design, tmp_path: Path
) -> None:
    path = tmp_path / "design.json"
    path.write_text(json.dumps(design_document(design)))
    made = bench(memory_station(len(design.cameras), design=path))
    record = made.rig.capture(made.session, "one").record
    assert {fault.kind for fault in record.faults} == {"wrong-size"}
    with pytest.raises(InputError, match=r"camera 'cam08' of the station is not in design\.json"):
        bench(memory_station(len(design.cameras) + 1, design=path))


def test_colmap_reads_the_rig_and_finds_the_pictures(designed: Bench, small: Design) -> None:
    """Read by COLMAP itself: folders, poses and lenses."""
    pycolmap = pytest.importorskip("pycolmap")
    folder = designed.session.folder
    (config,) = pycolmap.read_rig_config(folder / "rig/rig_config.json")
    placed = {f"rig1/{camera.name}/": camera for camera in small.cameras}
    reference = next(c for c in config.cameras if c.ref_sensor)
    assert reference.image_prefix == "rig1/cam01/"
    ref = placed[reference.image_prefix]
    point = np.array([30.0, -60.0, 20.0])
    for camera in config.cameras:
        truth = placed[camera.image_prefix]
        pixel, _ = truth.camera.project(truth.pose, point[None])
        local = ref.pose.to_camera(point[None])[0]
        if not camera.ref_sensor:
            local = camera.cam_from_rig * local
        # COLMAP's pixel centres are at halves. Quaternions are good to 1e-12.
        ours = camera.camera.img_from_cam(local[None])[0] - 0.5
        assert np.allclose(ours, pixel[0], atol=1e-6)


def test_colmap_groups_the_pictures_of_one_instant(designed: Bench, tmp_path: Path) -> None:
    pycolmap = pytest.importorskip("pycolmap")
    folder = designed.session.folder
    database_path = tmp_path / "colmap.db"
    with pycolmap.Database.open(database_path) as database:
        database.clear_all_tables()
    pycolmap.import_images(
        database_path, folder / "images", camera_mode=pycolmap.CameraMode.PER_FOLDER
    )
    with pycolmap.Database.open(database_path) as database:
        configs = pycolmap.read_rig_config(folder / "rig/rig_config.json")
        pycolmap.apply_rig_config(configs, database)
        assert database.num_images() == 2 * len(configs[0].cameras)
        assert database.num_rigs() == 1
        assert database.num_frames() == 2, "one frame for each instant"


def test_the_page_names_every_fault_and_place() -> None:
    page = Path(__file__).resolve().parents[4] / "docs/explanation/capture.md"
    text = page.read_text(encoding="utf-8")
    rows = dict(re.findall(r"\| `([a-z-]+)` \| [^|]+\|( yes)? ?\|", text))
    for kind in FaultKind:
        assert kind.value in rows, f"docs/explanation/capture.md does not tell {kind.value}"
        assert bool(rows[kind.value]) == (kind in HARMLESS)
    for place in (*paths.TABLES, paths.SESSION, paths.INCOMPLETE, paths.INTERRUPTED):
        assert place in text


def test_a_session_on_two_disks_is_told_before_anything_fires(bench: BenchMaker) -> None:
    made = bench()
    folder = made.session.folder
    (folder / "images").symlink_to("/proc")
    with pytest.raises(ConflictError, match="lies on two disks") as told:
        Stage(made.session, "one")
    assert told.value.code == "conflict/session-two-disks"
    assert not (folder / paths.INCOMPLETE).exists()
    with pytest.raises(ConflictError, match="lies on two disks"), disk_errors(folder):
        raise OSError(errno.EXDEV, "Invalid cross-device link")
