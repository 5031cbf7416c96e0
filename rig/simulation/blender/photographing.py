"""The scene photographed by Blender: its light on our sensors."""

from __future__ import annotations

import os
import subprocess
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from common.errors import InputError
from common.progress import (
    CancelToken,
    NeverCancelled,
    Progress,
    ProgressCallback,
    go_on,
    ignore_progress,
)
from rig.acquisition.cameras.base import Image
from rig.simulation.blender.handoff import SceneForBlender, picture_file
from rig.simulation.defocus import softened
from rig.simulation.studio import Shot, Studio

_INSIDE = Path(__file__).with_name("inside.py")
_TOLD = "rendered "
_WORDS = 300
"""Letters of Blender's last words that an error repeats."""

_LOOK_S = 0.05


@dataclass(frozen=True)
class BlenderPhotographer:
    """``program``: Blender 4.2 or newer, or a Python that has its module ``bpy``.

    ``samples`` rays for each pixel: what is left of their scatter is noise, about 1 % at 64.
    ``threads`` of Blender.
    """

    program: str = "blender"
    samples: int = 64
    threads: int = 1

    def __call__(
        self,
        studio: Studio,
        shots: Sequence[Shot],
        progress: ProgressCallback = ignore_progress,
        cancel: CancelToken | None = None,
    ) -> list[Image]:
        """A picture for each shot of the studio's head: Blender's light, counted by our sensors.

        The head is at rest, and nothing but it is shown. Noise, vignetting and blur of the lens
        are those of the studio; the rendering, the skin and the depth of field are Blender's.
        Raises :class:`InputError` where Blender cannot be run or fails, or a lens has distortion,
        and :class:`CancelledError` when told to stop.
        """
        surface = studio.surface
        if surface is None:
            raise InputError("blender-head", "the scene has no head to photograph", "give a head")
        cameras = [studio.cameras[shot.camera] for shot in shots]
        scene = SceneForBlender(
            studio.scene, self.samples, self.threads, studio.sensor.depth_of_field
        )
        with tempfile.TemporaryDirectory(prefix="rigwright-") as place:
            folder = Path(place)
            scene.write(folder, cameras, surface)
            progress(Progress("Blender begins", 0.0))
            names = _rendered(self.program, folder, cancel or NeverCancelled())
            done = 0
            for done, name in enumerate(names, 1):
                progress(Progress(f"Blender rendered {name}", done / len(shots)))
            if done < len(shots):
                raise InputError(
                    "blender-failed",
                    f"Blender rendered {done} of {len(shots)} pictures",
                    f"see whether {self.program} is Blender 4.2 or newer, or a Python with bpy",
                )
            return [
                studio.developed(shot, _light(folder, number, studio.sensor.lens_blur_px))
                for number, shot in enumerate(shots)
            ]


def _light(folder: Path, number: int, blur_px: float) -> NDArray[np.float32]:
    light: NDArray[np.float32] = np.load(folder / f"{picture_file(number)}.npy")
    return softened(light, blur_px)


def _command(program: str, folder: Path) -> list[str]:
    if "python" in Path(program).name:
        return [program, str(_INSIDE), str(folder)]
    plain = ["--background", "--factory-startup", "--python-exit-code", "1"]
    return [program, *plain, "--python", str(_INSIDE), "--", str(folder)]


def _rendered(program: str, folder: Path, cancel: CancelToken) -> Iterator[str]:
    """Names of cameras as their pictures are there."""
    last = ""
    with _process(_command(program, folder), _environment()) as process:
        # Blender may say nothing for minutes, so nobody who reads it would hear of a cancel.
        threading.Thread(target=_end_when_told, args=(process, cancel), daemon=True).start()
        for line in process.stdout or ():
            if line.startswith(_TOLD):
                yield line.removeprefix(_TOLD).strip()
            elif line.strip() and not line.startswith(("Fra:", "Saved:", "Time:")):
                last = line.strip()
        code = process.wait()
    go_on(cancel)
    if code != 0:
        raise InputError(
            "blender-failed",
            f"Blender ended with code {code}: {last[-_WORDS:] or 'it said nothing'}",
            f"see whether {program} is Blender 4.2 or newer, or a Python with bpy",
        )


def _end_when_told(process: subprocess.Popen[str], cancel: CancelToken) -> None:
    while process.poll() is None:
        if cancel.is_set():
            process.kill()
        time.sleep(_LOOK_S)


def _environment() -> Mapping[str, str]:
    # A path of ours would have Blender's Python import our libraries, which are of other versions.
    return {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}


@contextmanager
def _process(
    command: Sequence[str], environment: Mapping[str, str]
) -> Iterator[subprocess.Popen[str]]:
    try:
        process = subprocess.Popen(  # noqa: S603 - the program that the user named, no shell
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            env=environment,
        )
    except OSError as error:
        raise InputError(
            "blender-missing",
            f"{command[0]} cannot be run: {error.strerror}",
            "name Blender 4.2 or newer, or a Python that has its module bpy",
        ) from error
    try:
        yield process
    finally:
        process.kill()
        process.wait()
        if process.stdout is not None:
            process.stdout.close()
