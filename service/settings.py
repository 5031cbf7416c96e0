"""Settings of the service: from the environment, each with a default that suits a lab PC."""

from __future__ import annotations

import ipaddress
import os
import socket
from pathlib import Path
from typing import Annotated

from pydantic import Field, ValidationError, field_validator
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from common.errors import InputError

PREFIX = "RIGWRIGHT_"
_OF_COMMANDS = {"RIGWRIGHT_KEY"}
"""What commands read that ask a service."""


def default_data_folder() -> Path:
    """The user's data folder, as the XDG base directory specification has it."""
    base = os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share"
    return Path(base) / "rigwright"


class Settings(BaseSettings):
    """Set by environment variables such as ``RIGWRIGHT_PORT``."""

    model_config = SettingsConfigDict(env_prefix=PREFIX, extra="forbid", frozen=True)

    host: Annotated[
        str, Field(description="Address to listen on; 127.0.0.1 is this machine only.")
    ] = "127.0.0.1"
    port: Annotated[
        int, Field(ge=0, le=65535, description="Port to listen on; 0 takes a free one.")
    ] = 8000
    allowed_hosts: Annotated[
        tuple[str, ...],
        NoDecode,
        Field(
            description="Names under which the service may be asked, separated by commas, besides "
            "its address, `localhost` and this machine's name."
        ),
    ] = ()
    allowed_origins: Annotated[
        tuple[str, ...],
        NoDecode,
        Field(
            description="Origins of other web pages that may change something, separated by "
            "commas, such as `http://lab.example:3000`."
        ),
    ] = ()
    require_keys: Annotated[
        bool,
        Field(
            description="Whether 127.0.0.1 asks for keys as well, as every other address does: "
            "behind a proxy, for example."
        ),
    ] = False
    tls_cert: Annotated[
        Path | None,
        Field(description="Certificate (PEM, with its chain) to answer over HTTPS with."),
    ] = None
    tls_key: Annotated[Path | None, Field(description="Private key of the certificate (PEM).")] = (
        None
    )
    root_path: Annotated[
        str,
        Field(
            pattern=r"^(/[A-Za-z0-9._~-]+)*$",
            description="What a proxy puts before all paths, such as `/rigwright`.",
        ),
    ] = ""
    data_dir: Annotated[Path, Field(description="Folder for everything the service keeps.")] = (
        Field(default_factory=default_data_folder)
    )
    stations: Annotated[
        tuple[Path, ...],
        NoDecode,
        Field(description="Station files of the rigs to run, separated as in PATH."),
    ] = ()
    sessions_dir: Annotated[
        Path | None,
        Field(description="Folder for the sessions; `sessions` in the data folder without it."),
    ] = None
    session_grace_days: Annotated[
        float,
        Field(ge=0.0, le=3650.0, description="Days in which a removed session can be restored."),
    ] = 7.0
    max_upload_bytes: Annotated[int, Field(ge=1, description="Largest scan that is accepted.")] = (
        512 << 20
    )
    max_pictures_bytes: Annotated[
        int, Field(ge=1, description="Largest archive of pictures that is accepted.")
    ] = 4 << 30
    jobs_at_once: Annotated[int, Field(ge=1, le=64, description="Jobs that run side by side.")] = 1
    workers_per_job: Annotated[
        int, Field(ge=1, le=1024, description="Processes that one design may use.")
    ] = Field(default_factory=lambda: os.cpu_count() or 1)
    max_queued_jobs: Annotated[int, Field(ge=1, description="Jobs that may wait.")] = 100
    cancel_grace_s: Annotated[
        float, Field(ge=0.0, le=60.0, description="Seconds a cancelled job has to stop by itself.")
    ] = 0.8
    scan_time_limit_s: Annotated[
        float, Field(gt=0.0, description="Seconds that reading an uploaded scan may take.")
    ] = 180.0
    scan_memory_limit_bytes: Annotated[
        int, Field(ge=1 << 29, description="Address space for reading an uploaded scan.")
    ] = 8 << 30
    surface_memory_limit_bytes: Annotated[
        int, Field(ge=1 << 30, description="Address space of a reconstruction or comparison.")
    ] = 16 << 30

    @field_validator("stations", mode="before")
    @classmethod
    def _separated(cls, given: object) -> object:
        if isinstance(given, str):
            return [part for part in given.split(os.pathsep) if part]
        return given

    @field_validator("allowed_hosts", "allowed_origins", mode="before")
    @classmethod
    def _listed(cls, given: object) -> object:
        if isinstance(given, str):
            return [part.strip() for part in given.split(",") if part.strip()]
        return given

    @property
    def known_hosts(self) -> tuple[str, ...]:
        """All names under which the service may be asked."""
        machine = socket.gethostname()
        return ("localhost", machine, f"{machine}.local", self.host, *self.allowed_hosts)

    @property
    def asks_for_keys(self) -> bool:
        """Whether others than this machine may reach the service, or keys are wanted anyway."""
        return self.require_keys or not _this_machine_only(self.host)

    @property
    def sessions_folder(self) -> Path:
        """Where sessions are photographed into."""
        return self.sessions_dir or self.data_dir / "sessions"

    @property
    def units_dir(self) -> Path:
        """Where finished designs of studies are kept; nothing is lost where it is emptied."""
        return self.data_dir / "units"


def _this_machine_only(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        # A name may lead anywhere, and may lead elsewhere tomorrow.
        return False


def read_settings(**given: object) -> Settings:
    """The settings; ``given`` ones win over the environment.

    Raises :class:`InputError` for a value that cannot be and for a name that does not exist: a
    misspelt variable must not be ignored silently.
    """
    known = {PREFIX + name.upper() for name in Settings.model_fields}
    unknown = sorted(
        name
        for name in os.environ
        if name.upper().startswith(PREFIX) and name.upper() not in known | _OF_COMMANDS
    )
    if unknown:
        raise InputError(
            "settings",
            f"there is no setting {unknown[0]}",
            f"the settings are {', '.join(sorted(known))}",
        )
    try:
        return Settings.model_validate(
            {name: value for name, value in given.items() if value is not None}
        )
    except ValidationError as error:
        first = error.errors()[0]
        name = PREFIX + str(first["loc"][0]).upper()
        raise InputError(
            "settings", f"{name} is {first['input']!r}", first["msg"].lower()
        ) from error
