"""``rigwright recognise``: train on a population, enrol persons, verify faces."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from service.cli.options import JsonOption

if TYPE_CHECKING:
    from service.kinds.recognition import TrainingRequest

recognise = typer.Typer(
    name="recognise",
    help="Tell persons by the shape of their faces: train, enrol, verify.",
    no_args_is_help=True,
)

GalleryArgument = Annotated[
    Path, typer.Argument(metavar="GALLERY", help="The gallery, one file.", show_default=False)
]
FaceArgument = Annotated[
    Path,
    typer.Argument(
        metavar="FILE",
        help="The face: a cloud or mesh (PLY, GLB, glTF, OBJ, STL, 3MF, OFF or XYZ).",
        show_default=False,
    ),
]
NameOption = Annotated[
    str, typer.Option("--name", metavar="PERSON", help="Whose face it is.", show_default=False)
]
NOT_THE_PERSON = 4


@recognise.command("train")
def recognise_train(
    out: Annotated[
        Path, typer.Option("--out", metavar="MODEL", help="File to write.", show_default=False)
    ],
    folder: Annotated[
        Path | None,
        typer.Argument(
            metavar="FOLDER",
            help="Heads, several of each person: PERSON_*.ply, or a folder per person.",
            show_default=False,
        ),
    ] = None,
    population: Annotated[
        str | None,
        typer.Option(
            metavar="generator:N",
            help="N persons of the bundled generator instead of a folder.",
            show_default=False,
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Which persons it makes.")] = 0,
    false_match_rate: Annotated[
        float, typer.Option(metavar="RATE", help="How many strangers may be taken for a person.")
    ] = 0.001,
    force: Annotated[
        bool, typer.Option("--force", help="Replace a former model in which nobody is enrolled.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Train a model on many heads, and tell how often it errs on persons it has not seen.

    Exit code: 0 done, 2 bad input, 130 interrupted.

    Example:  rigwright recognise train heads --out model.npz
    """
    from service.cli.output import print_result_json
    from service.cli.running import one_line_errors, run_task
    from service.cli.tables import recognition_tables
    from service.kinds.recognition import TRAINING

    with one_line_errors():
        request, inputs = _population(folder, population, seed, false_match_rate)
        with _new_gallery(out, overwrite=force, enrolled_may_go=False) as made:
            result = run_task(TRAINING, request, inputs, made)
        if as_json:
            print_result_json(result, {out.name: out})
            return
        recognition_tables.print_training(result, out)


@recognise.command("enrol")
def recognise_enrol(
    gallery: GalleryArgument,
    face: FaceArgument,
    name: NameOption,
    model: Annotated[
        Path | None,
        typer.Option(
            metavar="MODEL",
            help="What `recognise train` wrote, for a gallery that is not there yet.",
            show_default=False,
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Put a person's face into a gallery; further captures of the same person are averaged.

    Exit code: 0 done, 2 bad input, 130 interrupted.

    Example:  rigwright recognise enrol lab.npz --model model.npz --name anna face/cloud.ply
    """
    from service.cli.output import print_result_json
    from service.cli.running import one_line_errors, run_task
    from service.cli.tables import recognition_tables
    from service.kinds.recognition import ENROLMENT, EnrolmentRequest

    with one_line_errors(), _locked(gallery):
        inputs = {"gallery": _base(gallery, model), "face": face}
        with _new_gallery(gallery, overwrite=True, enrolled_may_go=True) as made:
            result = run_task(ENROLMENT, EnrolmentRequest(name=name), inputs, made)
        if as_json:
            print_result_json(result, {gallery.name: gallery})
            return
        recognition_tables.print_enrolment(result, gallery)


@recognise.command("verify")
def recognise_verify(
    gallery: GalleryArgument, face: FaceArgument, name: NameOption, as_json: JsonOption = False
) -> None:
    """Tell whether a face is that of a person in the gallery.

    Exit code: 0 the same person, 4 not, 2 bad input, 130 interrupted.

    Example:  rigwright recognise verify lab.npz --name anna today/cloud.ply
    """
    import tempfile

    from service.cli.output import print_result_json
    from service.cli.running import one_line_errors, run_task
    from service.cli.tables import recognition_tables
    from service.kinds.recognition import VERIFICATION, VerificationRequest

    with one_line_errors(), tempfile.TemporaryDirectory(prefix="rigwright-") as temporary:
        request = VerificationRequest(name=name)
        inputs = {"gallery": gallery, "face": face}
        result = run_task(VERIFICATION, request, inputs, Path(temporary))
        if as_json:
            print_result_json(result, {})
        else:
            recognition_tables.print_verification(result)
        if not result.same:
            raise typer.Exit(NOT_THE_PERSON)


def _population(
    folder: Path | None, population: str | None, seed: int, rate: float
) -> tuple[TrainingRequest, dict[str, Path]]:
    from common.errors import InputError
    from common.files.strict import validated
    from evaluation.recognition.population import heads_in
    from service.kinds.recognition import TrainingRequest

    if (folder is None) == (population is None):
        problem = "either a folder of heads or --population generator:N is needed, not both"
        raise InputError("population", problem, "see --help")
    asked: dict[str, object] = {"seed": seed, "false_match_rate": rate}
    inputs: dict[str, Path] = {}
    if folder is not None:
        heads = heads_in(folder)
        asked |= {"persons": [h.person for h in heads], "population": folder.resolve().name}
        inputs = {f"head-{k}": head.path for k, head in enumerate(heads)}
    else:
        kind, _, count = str(population).partition(":")
        if kind != "generator" or not count.isdecimal() or int(count) == 0:
            raise InputError(
                "population", f"{population!r} is no population", "write generator:60, for example"
            )
        asked |= {"generated": int(count), "population": f"generator:{count}, seed {seed}"}
    return validated(TrainingRequest, asked, "the training"), inputs


def _base(gallery: Path, model: Path | None) -> Path:
    """What a person is added to: the gallery that is there, else the model."""
    from common.errors import InputError

    if gallery.exists():
        if model is not None:
            raise InputError(
                "gallery-model",
                f"{gallery} is there already and has its own model",
                "leave --model out, or name another gallery",
            )
        return gallery
    if model is None:
        raise InputError(
            "gallery-model", f"there is no gallery {gallery}", "give --model to begin one"
        )
    return model


@contextmanager
def _new_gallery(path: Path, *, overwrite: bool, enrolled_may_go: bool) -> Iterator[Path]:
    """A folder for a task to write a gallery into, which then becomes ``path``.

    Unless ``enrolled_may_go`` no gallery is replaced in which somebody is enrolled.
    """
    import tempfile

    from common.errors import ConflictError, InputError
    from common.files.writing import writable_place, write_whole

    if path.is_dir() or not path.parent.is_dir():
        what = f"{path} is a folder" if path.is_dir() else f"there is no folder {path.parent}"
        raise InputError("gallery-place", what, "give a file in a folder that is there")
    if path.exists():
        if not overwrite:
            raise ConflictError("file-exists", f"{path} is there already", "give --force")
        _refuse_loss(path, enrolled_may_go=enrolled_may_go)
    writable_place(path, overwrite=overwrite)
    with tempfile.TemporaryDirectory(prefix="rigwright-") as temporary:
        yield Path(temporary)
        data = (Path(temporary) / "gallery.npz").read_bytes()
        if overwrite and path.exists():
            # Looked at again: training takes long, and somebody may be enrolled by now.
            _refuse_loss(path, enrolled_may_go=enrolled_may_go)
        write_whole(path, data, overwrite=overwrite, private=True)


def _refuse_loss(path: Path, *, enrolled_may_go: bool) -> None:
    """Refuse to replace what is no gallery, whatever was said, and persons who were enrolled."""
    from common.errors import ConflictError
    from evaluation.recognition.galleryfile import read_gallery

    persons = list(read_gallery(path).persons)
    if persons and not enrolled_may_go:
        others = f" and {len(persons) - 1} more" if len(persons) > 1 else ""
        raise ConflictError(
            "gallery-enrolled",
            f"{path} is a gallery in which {persons[0]}{others} would be lost: nobody can be"
            " enrolled again but from their face",
            "give another --out, or remove the file yourself",
        )


@contextmanager
def _locked(gallery: Path) -> Iterator[None]:
    """One enrolment at a time: two that read the same gallery would lose one person."""
    from common.errors import ConflictError, InputError
    from common.files.lock import LockHeldError, lock_folder

    try:
        lock = lock_folder(gallery.parent)
    except LockHeldError as error:
        problem = f"somebody is being enrolled in {gallery.parent} at this moment"
        raise ConflictError("gallery-busy", problem, "try again") from error
    except OSError as error:
        problem = f"there is no folder {gallery.parent}"
        raise InputError(
            "gallery-place", problem, "give a file in a folder that is there"
        ) from error
    try:
        yield
    finally:
        lock.release()
