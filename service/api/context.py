"""What the request handlers work with."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import timedelta
from typing import Annotated, Any

from anyio import CapacityLimiter
from fastapi import Depends, Request

from common.errors import InternalError
from service.jobs.cancels import Cancels
from service.jobs.engine import Engine
from service.jobs.manager import JobManager
from service.jobs.notifier import Notifier
from service.jobs.process import ProcessEngine
from service.keys.audit import AuditLog
from service.keys.ring import KeyRing, require_a_key
from service.kinds.base import JobKind
from service.kinds.comparison import COMPARISON
from service.kinds.reconstruction import RECONSTRUCTION
from service.settings import Settings
from service.stations.registry import STATION_KINDS, StationRegistry, read_stations
from service.stations.worker import WorkerContext
from service.store import Store

_IMPORTS_AT_ONCE = 2
STEP_BACK = 10
"""How much less jobs count than the service, which must go on answering while cores are busy."""
_SURFACES = (RECONSTRUCTION.name, COMPARISON.name)
"""What grows with the pictures and clouds it is given, which nobody has measured before."""


class Service:
    """The parts of a running service. Opening it opens the store.

    ``before_data`` may raise while no folder is made yet.
    """

    def __init__(
        self,
        settings: Settings,
        kinds: Mapping[str, JobKind[Any, Any]],
        engine: Engine | None = None,
        before_data: Callable[[Settings], None] | None = None,
    ) -> None:
        self.settings = settings
        if settings.asks_for_keys:
            require_a_key(settings.data_dir, settings.host)
        stations = read_stations(settings.stations)
        if before_data is not None:
            before_data(settings)
        self.store = Store(settings.data_dir, settled_elsewhere=STATION_KINDS)
        self.audit = AuditLog(settings.data_dir)
        ring = KeyRing(settings.data_dir, self.store.sign_ins)
        self.keys = ring if settings.asks_for_keys else None
        self.engine = engine or ProcessEngine(settings.cancel_grace_s, step_back=STEP_BACK)
        self.notifier = Notifier()
        self.cancels = Cancels(self.store, self.notifier)
        limited = {
            name: replace(kind, memory_limit_bytes=settings.surface_memory_limit_bytes)
            if name in _SURFACES
            else kind
            for name, kind in kinds.items()
        }
        self.jobs = JobManager(
            self.store, self.engine, limited, self.notifier, self.cancels, settings.jobs_at_once
        )
        context = WorkerContext(self.store, self.notifier, self.cancels)
        self.rigs = StationRegistry(
            stations,
            settings.sessions_folder,
            context,
            timedelta(days=settings.session_grace_days),
        )
        self.stopping = threading.Event()
        self.imports = CapacityLimiter(_IMPORTS_AT_ONCE)
        # A look takes a core for a second; those that wait must not hold the threads that abort.
        self.looks = CapacityLimiter(1)

    def start(self) -> None:
        """Begin with the jobs that wait, and open the rigs."""
        self.jobs.start()
        self.rigs.start()

    def announce_stop(self) -> None:
        """End what would keep connections open: event streams and imports of scans."""
        self.stopping.set()
        self.notifier.close()

    def stop(self) -> None:
        """Stop all work; jobs that run are marked interrupted."""
        self.announce_stop()
        self.jobs.stop()
        self.rigs.stop()

    def close(self) -> None:
        """Let go of the store."""
        self.store.close()
        self.audit.close()


def the_service(request: Request) -> Service:
    """The service that an application was made for."""
    service = getattr(request.app.state, "service", None)
    if not isinstance(service, Service):
        raise InternalError(
            "no-service", "the application has no service", "use service.api.app.create_app"
        )
    return service


ServiceDep = Annotated[Service, Depends(the_service)]
