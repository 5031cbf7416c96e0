"""The heads of a study, known by what they are and not by what they are called."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from rig.specification.rigfile import RigFile
from rig.study.studyfile import Study
from rig.study.unit import Head

ROLE = "head-{}"
"""What the scans are called among the inputs of a study, from 1."""


def heads_of(
    study: Study, names: Sequence[str], inputs: Mapping[str, Path]
) -> tuple[list[Head], dict[str, Path]]:
    """All heads, files first, and the files by their hash; without any the bundled head.

    ``names``: what to call the files of ``inputs``, in the order of their roles.
    """
    heads, files = [], {}
    for number in range(len(inputs)):
        path = inputs[ROLE.format(number + 1)]
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        name = names[number] if number < len(names) else path.name
        heads.append(Head(name=name, sha256=digest))
        files[digest] = path
    heads += [Head(name=f"person {seed}", seed=seed) for seed in study.population_seeds()]
    return heads or [Head(name="the bundled head")], files


def study_identity(study: Study, rigs: Sequence[RigFile], heads: Sequence[Head]) -> str:
    """The hash of what was asked, whatever the files are called."""
    asked = {
        "study": study.model_dump(mode="json"),
        "rigs": [rig.model_dump(mode="json", by_alias=True) for rig in rigs],
        "heads": [head.identity() for head in heads],
    }
    return hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()
