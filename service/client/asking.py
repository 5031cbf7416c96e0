"""HTTP to a running service: its answers as models, its problems as the errors they began as."""

from __future__ import annotations

import ssl
from typing import TypeVar
from urllib.parse import urlsplit

import httpx2
from pydantic import BaseModel, ConfigDict, ValidationError

from common.errors import ConflictError, DeviceError, InputError, RigwrightError
from service.ipc import error_from_fields

ModelT = TypeVar("ModelT", bound=BaseModel)
TIMEOUT_S = 20.0
"""The service answers at once or not at all; what takes long is a job."""


class Seen(BaseModel):
    """Base of what is read of an answer: what a newer service says besides is not looked at."""

    model_config = ConfigDict(extra="ignore", frozen=True)


class ProblemSeen(Seen):
    """An error as it comes over HTTP (RFC 9457)."""

    type: str
    detail: str
    remedy: str

    def error(self) -> RigwrightError:
        """The error that the service met."""
        kind, _, detail = self.type.removeprefix("/problems/").partition("/")
        problem = self.detail.removesuffix(f"; {self.remedy}")
        fields = {"kind": kind, "detail": detail, "problem": problem, "remedy": self.remedy}
        try:
            return error_from_fields(fields)
        except KeyError:
            return ConflictError("service-answer", problem, self.remedy)


class Service:
    """A running service at ``url``, asked with a ``key`` where it wants one.

    ``certificate``: the file of the one it must have; without it those that the system trusts,
    and that of ``SSL_CERT_FILE``.
    """

    def __init__(self, url: str, key: str | None = None, certificate: str | None = None) -> None:
        self.url = _base(url)
        headers = {"X-Rigwright": "1"}
        if key:
            headers["Authorization"] = f"Bearer {key}"
        self._http = httpx2.Client(
            headers=headers, timeout=TIMEOUT_S, trust_env=False, verify=_trust(certificate)
        )

    def close(self) -> None:
        """Let go of the connection."""
        self._http.close()

    def read(self, path: str, model: type[ModelT]) -> ModelT:
        """GET ``path`` below ``/v1``. Raises as :meth:`send`."""
        return self._asked("GET", path, None, model)

    def send(self, path: str, body: BaseModel | None, model: type[ModelT]) -> ModelT:
        """POST to ``path`` below ``/v1``.

        Raises what the service answered, and :class:`DeviceError` ``service-gone`` when it does
        not answer.
        """
        text = "{}" if body is None else body.model_dump_json(exclude_unset=True)
        return self._asked("POST", path, text, model)

    def _asked(self, method: str, path: str, body: str | None, model: type[ModelT]) -> ModelT:
        headers = {} if body is None else {"Content-Type": "application/json"}
        try:
            answer = self._http.request(
                method, f"{self.url}/v1/{path}", content=body, headers=headers
            )
        except httpx2.HTTPError as error:
            raise self._gone(str(error) or type(error).__name__) from None
        try:
            if not answer.is_success:
                raise self._refused(answer)
            return model.model_validate_json(answer.content)
        except ValidationError:
            raise self._gone(f"HTTP {answer.status_code}, and no answer of Rigwright") from None

    def _refused(self, answer: httpx2.Response) -> RigwrightError:
        error = ProblemSeen.model_validate_json(answer.content).error()
        if error.code in ("input/key-needed", "input/key-wrong"):
            return InputError(
                error.detail,
                f"the service at {self.url} wants a key, and got "
                f"{'none' if error.detail == 'key-needed' else 'a wrong one'}",
                "give one in RIGWRIGHT_KEY, or with --key",
            )
        return error

    def _gone(self, why: str) -> DeviceError:
        return DeviceError(
            "service-gone",
            f"the service at {self.url} does not answer ({why})",
            "see whether it runs, and whether --server is its address",
        )


def _trust(certificate: str | None) -> ssl.SSLContext:
    """Whom to believe: exactly the holder of a certificate, whatever name it is for."""
    if certificate is None:
        return ssl.create_default_context()
    try:
        context = ssl.create_default_context(cafile=certificate)
    except OSError as error:
        raise InputError(
            "server",
            f"the service's certificate {certificate} cannot be read ({error.strerror})",
            "name the service with --server",
        ) from error
    context.check_hostname = False
    context.verify_flags |= ssl.VerifyFlags.VERIFY_X509_PARTIAL_CHAIN
    return context


def _base(url: str) -> str:
    parts = urlsplit(url)
    if parts.scheme not in ("http", "https") or not parts.hostname:
        raise InputError(
            "server", f"{url!r} is no address of a service", "give one like http://rig-pc:8000"
        )
    return url.rstrip("/").removesuffix("/v1")
