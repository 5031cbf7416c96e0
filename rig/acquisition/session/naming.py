"""Names at the box, and tokens of two origins."""

from __future__ import annotations

import hashlib
import secrets

from common.progress import CancelToken

BOX_ID_LENGTH = 12


class EitherToken:
    """A cancel token that is set when one of two is."""

    def __init__(self, one: CancelToken, other: CancelToken) -> None:
        self._one, self._other = one, other

    def is_set(self) -> bool:
        """Whether one of them is set."""
        return self._one.is_set() or self._other.is_set()


def box_name(*parts: str) -> str:
    """A capture's name at the box: 12 characters that were never used before.

    The client's own id may be longer, and may be tried again after a refusal; the box must see
    another name each time, because it fires each name only once.
    """
    text = "/".join((*parts, secrets.token_hex(8)))
    return hashlib.sha256(text.encode()).hexdigest()[:BOX_ID_LENGTH]
