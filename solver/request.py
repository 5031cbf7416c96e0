"""What is to be designed, understood and checked."""

from __future__ import annotations

from dataclasses import dataclass

from common.errors import InputError
from geometry.arrays import Floats
from geometry.camera import Camera, RigCamera
from geometry.frames import Pose
from geometry.subject import Subject
from solver.limits import Limits
from solver.problem import Problem
from solver.strategy import Strategy


@dataclass(frozen=True, eq=False)
class Request:
    """What is to be designed. See :func:`design` for the fields."""

    subject: Subject
    camera: Camera
    limits: Limits
    count: int
    seed: int
    starts: int
    fixed: tuple[RigCamera, ...]
    start: tuple[Pose, ...] | None
    strategy: Strategy

    def __post_init__(self) -> None:
        total = self.count + len(self.fixed)
        views = max((t.views for t in self.limits.coverage.tiers), default=1)
        given = None if self.start is None else len(self.start)
        problems = (
            (
                self.count < 1,
                "no-cameras",
                f"{self.count} cameras are to be placed",
                "ask for at least one",
            ),
            (
                self.starts < 1,
                "starts",
                f"{self.starts} starts are asked for",
                "ask for at least one start",
            ),
            (
                views > total,
                "limits-contradict",
                f"coverage asks for {views} views of each point, but there are {total} cameras",
                "ask for fewer views or more cameras",
            ),
            (
                given is not None and given != self.count,
                "start-count",
                f"{given} start poses are given for {self.count} cameras",
                "give one start pose per camera",
            ),
        )
        for wrong, detail, problem, remedy in problems:
            if wrong:
                raise InputError(detail, problem, remedy)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the cameras to be placed: cam01, cam02, ..., passing over fixed ones."""
        taken = {c.name for c in self.fixed}
        fresh = (f"cam{k:02d}" for k in range(1, self.count + len(taken) + 1))
        return tuple(n for n in fresh if n not in taken)[: self.count]

    @property
    def anchor(self) -> tuple[Pose, ...] | None:
        """Poses about which Eq 8 bounds the cameras; without given ones, each start's own."""
        if self.start is None:
            return None
        return (*(c.pose for c in self.fixed), *self.start)

    def problem(self, cameras: tuple[RigCamera, ...]) -> Problem:
        """The problem that starts from these cameras."""
        everyone = (*self.fixed, *cameras)
        anchor = self.anchor or tuple(c.pose for c in everyone)
        return Problem(self.subject, everyone, self.limits, anchor)

    @property
    def target_mm(self) -> Floats:
        """What cameras look at from given poses (3,): the middle of the design points."""
        return self.subject.design_points.centroid_mm
