"""Assembly steps as text."""

from __future__ import annotations

import re

from rig.build.mounts.plan import MountPlan

NUMBER = re.compile(r"^\d+\.\s+")


def plain_steps(plan: MountPlan) -> tuple[str, ...]:
    """The steps in order, without the numbers that some begin with."""
    return tuple(NUMBER.sub("", step) for step in plan.steps)


def steps_text(plan: MountPlan) -> str:
    """The assembly steps, numbered, and the notes."""
    lines = [f"{number}. {step}" for number, step in enumerate(plain_steps(plan), 1)]
    notes = [f"Note: {note}" for note in plan.notes]
    return "\n".join([plan.name, "", *lines, *([""] if notes else []), *notes]) + "\n"
