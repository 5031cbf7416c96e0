"""``/metrics``: figures for Prometheus, read from the service when they are asked for."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator

from fastapi import APIRouter, Request, Response
from prometheus_client import CollectorRegistry, Counter, Histogram, ProcessCollector
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.exposition import CONTENT_TYPE_PLAIN_0_0_4, generate_latest
from prometheus_client.registry import Collector
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.context import Service, ServiceDep
from service.api.responses import Responses
from service.stations.status import box_is_able
from service.stations.worker import StationWorker
from service.store.tables import JobStatus

router = APIRouter(tags=["service"])
_TEXT: Responses = {
    200: {
        "description": "Prometheus' text format.",
        "content": {"text/plain": {"schema": {"type": "string"}}},
    }
}
_METHODS = ("GET", "POST", "DELETE")


@router.get("/metrics", response_class=Response, responses=_TEXT)
def read_metrics(request: Request, service: ServiceDep) -> Response:
    """Read figures of requests, jobs, disk and devices, as Prometheus asks for them."""
    registry = CollectorRegistry(auto_describe=False)
    registry.register(_State(service))
    ProcessCollector(registry=registry)
    text = generate_latest(request.app.state.requests.registry) + generate_latest(registry)
    return Response(text, headers={"Content-Type": CONTENT_TYPE_PLAIN_0_0_4})


class _State(Collector):
    """The service as it is now."""

    def __init__(self, service: Service) -> None:
        self._service = service

    def collect(self) -> Iterator[Metric]:
        """The figures."""
        counts = self._service.store.jobs.counts()
        jobs = GaugeMetricFamily("rigwright_jobs", "Jobs by their status.", labels=["status"])
        for status in JobStatus:
            jobs.add_metric([status.value], counts.get(status, 0))
        yield jobs
        free = shutil.disk_usage(self._service.store.folder).free
        yield GaugeMetricFamily("rigwright_disk_free_bytes", "Room for data.", value=free)
        writable = not self._service.store.database.refused
        yield GaugeMetricFamily(
            "rigwright_store_writable", "Whether the last change was written.", value=writable
        )
        yield from _devices(self._service.rigs.all())


def _devices(workers: list[StationWorker]) -> Iterator[Metric]:
    opened = GaugeMetricFamily("rigwright_rig_open", "Whether it is open.", labels=["rig"])
    busy = GaugeMetricFamily("rigwright_rig_busy", "Whether it does something.", labels=["rig"])
    box = GaugeMetricFamily(
        "rigwright_trigger_box_ready", "Whether the box can fire.", labels=["rig"]
    )
    interlock = GaugeMetricFamily(
        "rigwright_interlock_closed", "Whether it may fire.", labels=["rig"]
    )
    cameras = GaugeMetricFamily(
        "rigwright_camera_connected", "Whether it is there.", labels=["rig", "camera"]
    )
    for worker in workers:
        health, _, doing = worker.health()
        opened.add_metric([worker.name], health is not None)
        busy.add_metric([worker.name], doing is not None)
        if health is not None and health.box is not None:
            box.add_metric([worker.name], bool(box_is_able(health)))
            if health.box.interlock_closed is not None:
                interlock.add_metric([worker.name], health.box.interlock_closed)
        for plan in worker.station.cameras:
            camera = None if health is None else health.cameras.get(plan.name)
            there = camera is not None and camera.connected
            cameras.add_metric([worker.name, plan.name], there)
    yield from (opened, busy, box, interlock, cameras)


class RequestCounts:
    """Requests by method, route and status, in a registry of their own."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        self._number = Counter(
            "rigwright_requests",
            "Requests answered.",
            ("method", "route", "status"),
            registry=self.registry,
        )
        self._time = Histogram(
            "rigwright_request_seconds",
            "From a request's head to the end of its answer.",
            ("method", "route"),
            registry=self.registry,
        )

    def add(self, method: str, route: str, status: int, seconds: float) -> None:
        """Add one request. ``status`` is 0 where there was no answer."""
        known = method if method in _METHODS else "other"
        self._number.labels(known, route, str(status)).inc()
        self._time.labels(known, route).observe(seconds)


class CountedRequests:
    """ASGI middleware: how many requests there were, and how long their answers took."""

    def __init__(self, app: ASGIApp, counts: RequestCounts) -> None:
        self._app = app
        self._counts = counts

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        began_s, status = time.monotonic(), 0

        async def send_seen(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
            await send(message)

        try:
            await self._app(scope, receive, send_seen)
        finally:
            # The route's own path, not what was asked for: anybody could make up any number.
            route = getattr(scope.get("route"), "path", "none")
            self._counts.add(scope["method"], route, status, time.monotonic() - began_s)
