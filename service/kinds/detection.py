"""What was found in pictures of targets: part of every measurement's result."""

from __future__ import annotations

from service.kinds.base import Result


class CameraPictures(Result):
    """What detection found in one camera's pictures."""

    name: str
    pictures: int
    targets: int


class RuleCount(Result):
    """How many targets were seen and not used, by one rule of ``docs/how-to/targets.md``."""

    rule: str
    count: int


class Detection(Result):
    """What was found in all pictures."""

    pictures: int
    frames: int
    targets: int
    cameras: list[CameraPictures]
    rejected: list[RuleCount]
