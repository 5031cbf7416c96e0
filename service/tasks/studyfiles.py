"""A study file and its rig files, read from their texts as the command reads them."""

from __future__ import annotations

from pathlib import PurePosixPath

from common.errors import InputError
from rig.specification.rigfile import parse_rig_file
from rig.study.studyfile import parse_study
from service.kinds.study import ReadStudy, StudyFiles


def read_study(files: StudyFiles) -> ReadStudy:
    """What the files ask for. Raises a one-line :class:`InputError`."""
    file = parse_study(files.study.text, files.study.name)
    given = {rig.name: rig.text for rig in files.rigs}
    rigs = []
    for name in _alone(file.rigs):
        if name not in given:
            raise InputError(
                "study-rigs",
                f"{files.study.name} names the rig file {name!r}, which was not given with it",
                "give the study file and all of its rig files at once",
            )
        rigs.append(parse_rig_file(given[name], name))
    return ReadStudy(study=file.study(), rigs=rigs, heads=_alone(file.heads))


def _alone(paths: list[str]) -> list[str]:
    """Names without folders. Raises :class:`InputError` where two are alike without them."""
    names = [PurePosixPath(path.replace("\\", "/")).name for path in paths]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(
            "study-names",
            f"two files of the study are called {twice[0]!r}, in folders that are not known here",
            "give each a name of its own",
        )
    return names
