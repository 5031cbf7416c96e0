"""The few error types of Rigwright.

Every error carries a stable ``code`` (``kind/detail``), one sentence on what is wrong and
one on what to do. They are mapped to HTTP problems and exit codes in one place, in
``service``; nothing below ``service`` knows about either.
"""

from __future__ import annotations


class RigwrightError(Exception):
    """Base of all errors that a user can act on.

    ``detail`` is a stable slug such as ``scan-empty``; ``problem`` says what is wrong,
    ``remedy`` what to do about it. ``str()`` gives both on one line.
    """

    kind = "error"

    def __init__(self, detail: str, problem: str, remedy: str) -> None:
        self.detail = detail
        self.problem = " ".join(problem.split())
        self.remedy = " ".join(remedy.split())
        super().__init__(f"{self.problem}; {self.remedy}")

    def __reduce__(self) -> tuple[type[RigwrightError], tuple[str, str, str]]:
        """Errors cross process boundaries whole."""
        return type(self), (self.detail, self.problem, self.remedy)

    @property
    def code(self) -> str:
        """Stable identifier, for example ``input/scan-empty``."""
        return f"{self.kind}/{self.detail}"


class InputError(RigwrightError):
    """Something that was given (a file, a limit, an option) cannot be used as it is."""

    kind = "input"


class TooLargeError(InputError):
    """What was given is well formed as far as is known, but larger than is accepted."""

    kind = "too-large"


class NotFoundError(RigwrightError):
    """What was asked for does not exist."""

    kind = "not-found"


class ConflictError(RigwrightError):
    """The request is sound but cannot be met in the present state."""

    kind = "conflict"


class UnsatisfiableError(RigwrightError):
    """The limits cannot all be met."""

    kind = "unsatisfiable"


class DeviceError(RigwrightError):
    """A device, or what reaches it, is missing, silent or not what it should be.

    Details: ``trigger-gone``, ``trigger-wrong``, ``trigger-busy``, ``camera-gone``,
    ``camera-not-ready``, ``backend-missing`` and further ones named where they are raised.
    """

    kind = "device"


class InterlockError(RigwrightError):
    """The interlock of the trigger box is open: nothing may fire."""

    kind = "interlock"


class CancelledError(RigwrightError):
    """The work was cancelled by request; nothing was written."""

    kind = "cancelled"

    def __init__(
        self,
        detail: str = "by-request",
        problem: str = "the work was cancelled",
        remedy: str = "start it again when it is wanted",
    ) -> None:
        super().__init__(detail, problem, remedy)


class InternalError(RigwrightError):
    """A fault of Rigwright itself, not of its input."""

    kind = "internal"
