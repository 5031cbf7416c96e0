"""Units on a Dask cluster, behind the same seam as worker processes.

The cluster's own scheduler gives a unit to another worker when one dies; what was finished is on
this machine's disk already, so a scheduler that dies costs no more than what was under way.
"""

from __future__ import annotations

import tempfile
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, Future, InvalidStateError
from contextlib import contextmanager, suppress
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from common.errors import DeviceError
from common.files.writing import write_whole
from common.progress import CancelToken
from rig.study.running import Files, OpenExecutor, UnitLostError, compute
from rig.study.unit import Unit, UnitResult

if TYPE_CHECKING:
    from distributed import Client

AT_ONCE = 1000
"""Units handed to the cluster at a time: it keeps those that wait, and workers may join."""

_CONNECT_S = 10.0
_ANSWER_S = 60.0
_LOOK_EVERY_S = 1.0

Contents = tuple[tuple[str, str, bytes], ...]
"""The scans: hash, name and bytes of each."""


def cluster(address: str) -> OpenExecutor:
    """The workers of the Dask scheduler at ``address``, such as ``tcp://host:8786``.

    Opening it raises :class:`DeviceError` where there is none, where it has no workers, and
    where the extra ``dask`` is not installed.
    """

    @contextmanager
    def opened(_cancel: CancelToken) -> Iterator[Executor]:
        client = _connected(address)
        try:
            if not client.nthreads():
                raise DeviceError(
                    "cluster-empty",
                    f"the Dask scheduler at {address} has no workers",
                    f"start some on it: dask worker {address} --nthreads 1",
                )
            with _OnCluster(client, address) as executor:
                yield executor
        finally:
            client.close(timeout=2)

    return opened


def _connected(address: str) -> Client:
    try:
        from distributed import Client
    except ImportError as error:
        raise DeviceError(
            "backend-missing", "Dask is not installed", "pip install 'rigwright[dask]'"
        ) from error
    try:
        return Client(address, timeout=_CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise DeviceError(
            "cluster-gone",
            f"no Dask scheduler answers at {address}",
            "start one with dask scheduler, and give its address as tcp://HOST:PORT",
        ) from error


class _OnCluster(Executor):
    """Hands units to a cluster. Scans go there once, and again when all who held them died."""

    def __init__(self, client: Client, address: str) -> None:
        self._client, self._address = client, address
        self._contents: Any = None
        self._remote: set[Any] = set()
        self._waited_for: set[Future[Any]] = set()
        self._sending, self._ended = threading.Lock(), threading.Event()
        threading.Thread(target=self._watch, name="cluster-watch", daemon=True).start()

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:  # noqa: ARG002
        """Nobody waits for what is still there."""
        self._ended.set()

    def _watch(self) -> None:
        """A client whose scheduler closed in good order never says so of its futures."""
        while not self._ended.wait(_LOOK_EVERY_S):
            comm = self._client.scheduler_comm
            if self._client.status != "running" or comm is None or comm.comm.closed():
                for future in tuple(self._waited_for):
                    self._end(future, self._gone())

    def _end(self, future: Future[Any], error: Exception) -> None:
        self._waited_for.discard(future)
        with suppress(InvalidStateError):
            future.set_exception(error)

    def submit(self, fn: Any, /, *args: Any, **_: Any) -> Future[Any]:  # noqa: ANN401, ARG002
        """The unit's result as a future; :func:`compute` is what every worker does."""
        unit, files = args
        future: Future[Any] = Future()
        self._waited_for.add(future)
        self._send(unit, files, future)
        return future

    def _send(self, unit: Unit, files: Files, future: Future[Any]) -> None:
        with self._sending:
            if self._contents is None:
                self._contents = self._client.scatter(
                    [_contents(files)], broadcast=True, timeout=_CONNECT_S
                )[0]
            remote = self._client.submit(compute_there, unit, self._contents, pure=False)
            self._remote.add(remote)
        remote.add_done_callback(partial(self._hand_over, unit, files, future))

    def _hand_over(
        self,
        unit: Unit,
        files: Files,
        future: Future[Any],
        remote: Any,  # noqa: ANN401
    ) -> None:
        from distributed import KilledWorker

        self._remote.discard(remote)
        try:
            result = remote.result(timeout=_ANSWER_S)
        except KilledWorker:
            self._end(future, UnitLostError())
        except Exception as error:  # noqa: BLE001 - it belongs to whoever waits for the future
            self._after_loss(unit, files, future, None if remote.status != "error" else error)
        else:
            self._waited_for.discard(future)
            with suppress(InvalidStateError):
                future.set_result(result)

    def _after_loss(
        self, unit: Unit, files: Files, future: Future[Any], error: Exception | None
    ) -> None:
        """A unit that failed keeps its error; one that lost its scans is sent again with them."""
        try:
            if error is None and self._client.status == "running":
                self._contents = None
                self._send(unit, files, future)
                return
        except Exception:  # noqa: BLE001 - the connection broke meanwhile
            error = None
        self._end(future, error or self._gone())

    def _gone(self) -> DeviceError:
        return DeviceError(
            "cluster-gone",
            f"the Dask scheduler at {self._address} is gone",
            "start it, then give the same command again: what was finished is kept",
        )


def _contents(files: Files) -> Contents:
    return tuple((digest, path.name, path.read_bytes()) for digest, path in files.items())


def compute_there(unit: Unit, contents: Contents) -> UnitResult:
    """What a worker of a cluster does: the same as any, with the scans as files of its own."""
    files = {}
    for digest, name, data in contents:
        # Readers go by the ending of the name.
        files[digest] = _folder() / f"{digest}{Path(name).suffix}"
        if not files[digest].exists():
            write_whole(files[digest], data, overwrite=True)
    return compute(unit, files)


@lru_cache(maxsize=1)
def _kept() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="rigwright-study-")


def _folder() -> Path:
    return Path(_kept().name)
