"""The keys as a running service knows them: who asks, and how often somebody guessed wrongly."""

from __future__ import annotations

import threading
import time
from collections import deque
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address, ip_network
from pathlib import Path

from common.errors import ConflictError, InputError
from service.keys.keyfile import FILE_NAME, Key, digest, new_token, read_keys
from service.logs import log
from service.store.signins import SignIns

SIGNED_IN_FOR = timedelta(hours=16)
"""A lab's day: whoever signs in in the morning is not asked again before the evening."""

WRONG_ALLOWED = 10
WRONG_WITHIN_S = 60.0
_ADDRESSES_AT_MOST = 10_000


@dataclass(frozen=True)
class Visitor:
    """Somebody with a sound key; ``until`` is when it, or the sign-in, ends."""

    key: Key
    until: datetime | None
    signed_in: str | None
    """The hash of the sign-in's token; None for whoever sends the key itself."""


def require_a_key(folder: Path, host: str) -> None:
    """Raise :class:`InputError` where nobody could ask a service that others can reach."""
    if not any(key.valid() for key in read_keys(folder)):
        raise InputError(
            "keys-none",
            f"others can reach a service on {host or 'all addresses'}, and there is no valid key",
            f"make one first: rigwright keys add NAME --scope hardware --data {folder}",
        )


class KeyRing:
    """Keys by their hashes, read again when their file has changed. For any thread."""

    def __init__(self, folder: Path, sign_ins: SignIns) -> None:
        self._path = folder / FILE_NAME
        self._folder = folder
        self._sign_ins = sign_ins
        self._lock = threading.Lock()
        self._seen: tuple[int, int, int] | None = None
        self._keys: dict[str, Key] = {}
        self._wrong: dict[str, deque[float]] = {}
        self._proven: set[str] = set()

    def with_key(self, token: str, address: str) -> Visitor:
        """Who has this key.

        Raises :class:`InputError` ``key-wrong``, and :class:`ConflictError` ``keys-guessed``
        after many wrong ones from an address: then only keys that were right before are looked
        at from there, so that a guesser keeps nobody out who is in.
        """
        found = digest(token)
        if found not in self._proven and self._guesses(address) >= WRONG_ALLOWED:
            raise ConflictError(
                "keys-guessed",
                "too many wrong keys came from this address",
                f"wait {WRONG_WITHIN_S:.0f} s",
            )
        key = self._valid().get(found)
        if key is None:
            self._note_wrong(address)
            raise InputError(
                "key-wrong",
                "this key is not known, or no longer valid",
                "see `rigwright keys list` on the service's machine",
            )
        self._proven.add(found)
        return Visitor(key, key.expires_at, None)

    def sign_in(self, token: str, address: str) -> tuple[Visitor, str]:
        """Who has this key, and a token for the browser. Raises as :meth:`with_key`."""
        visitor = self.with_key(token, address)
        key, made = visitor.key, new_token()
        ends = datetime.now(UTC) + SIGNED_IN_FOR
        until = ends if key.expires_at is None else min(ends, key.expires_at)
        self._sign_ins.add(digest(made), key.sha256, until)
        return Visitor(key, until, digest(made)), made

    def signed_in(self, token: str) -> Visitor:
        """Who signed in with this token. Raises :class:`InputError` ``signed-out``."""
        visitor = self._found(digest(token))
        if visitor is None:
            raise InputError("signed-out", "the sign-in has ended", "sign in again with your key")
        return visitor

    def sign_out(self, visitor: Visitor) -> None:
        """End a sign-in; whoever sent the key itself has none."""
        if visitor.signed_in is not None:
            self._sign_ins.remove(visitor.signed_in)

    def still(self, visitor: Visitor) -> bool:
        """Whether a visitor may go on: the key neither expired nor revoked, nor signed out."""
        if visitor.signed_in is not None:
            return self._found(visitor.signed_in) is not None
        return visitor.key.sha256 in self._valid()

    def _found(self, sign_in: str) -> Visitor | None:
        entry = self._sign_ins.get(sign_in)
        key = None if entry is None else self._valid().get(entry.key_sha256)
        if entry is None or key is None or entry.ends_at <= datetime.now(UTC):
            return None
        return Visitor(key, entry.ends_at, sign_in)

    def _valid(self) -> dict[str, Key]:
        with self._lock:
            seen = self._mark()
            if seen != self._seen:
                self._seen, self._keys = seen, self._read()
            return {sha256: key for sha256, key in self._keys.items() if key.valid()}

    def _mark(self) -> tuple[int, int, int] | None:
        try:
            found = self._path.stat()
        except OSError:
            return None
        return found.st_mtime_ns, found.st_size, found.st_ino

    def _read(self) -> dict[str, Key]:
        try:
            return {key.sha256: key for key in read_keys(self._folder)}
        except InputError as error:
            # Nobody gets in by a broken file.
            log.error("keys unreadable", extra={"fields": {"why": str(error)}})
            return {}

    def _guesses(self, address: str) -> int:
        with self._lock:
            return len(self._recent(_network(address)))

    def _note_wrong(self, address: str) -> None:
        with self._lock:
            if len(self._wrong) >= _ADDRESSES_AT_MOST:
                self._wrong = {net: kept for net in self._wrong if (kept := self._recent(net))}
            self._wrong.setdefault(_network(address), deque()).append(time.monotonic())

    def _recent(self, network: str) -> deque[float]:
        times = self._wrong.get(network, deque())
        while times and time.monotonic() - times[0] > WRONG_WITHIN_S:
            times.popleft()
        return times


def _network(address: str) -> str:
    """An address, or of IPv6 the network that one customer has whole."""
    try:
        parsed = ip_address(address)
    except ValueError:
        return address
    return address if parsed.version == 4 else str(ip_network((parsed, 64), strict=False))
