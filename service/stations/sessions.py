"""The sessions of one place on disk: found by name, at most one open at a time."""

from __future__ import annotations

from pathlib import Path

from common.errors import NotFoundError
from rig.acquisition.capture.rig import Rig
from rig.acquisition.session.folder import Session


class Sessions:
    """Sessions under ``root``. Used by one thread, except for :meth:`folder_of`.

    Whoever calls :meth:`let_go_of` keeps that thread from beginning anything.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self._open: Session | None = None

    def folder_of(self, name: str) -> Path:
        """Where the session of that name lies. Names are checked before they come here."""
        return self.root / name

    def get(self, name: str, rig: Rig, subject: str, operator: str) -> Session:
        """The session of that name, begun now with this rig if there is none."""
        folder = self.folder_of(name)
        if self._open is not None and self._open.folder == folder:
            return self._open
        self.close()
        try:
            self._open = Session.open(folder)
        except NotFoundError:
            self._open = rig.new_session(folder, subject, operator)
        return self._open

    def let_go_of(self, folder: Path) -> None:
        """Close that session, where it is the open one."""
        if self._open is not None and self._open.folder == folder:
            self.close()

    def close(self) -> None:
        """Let go of the open session."""
        if self._open is not None:
            self._open.close()
            self._open = None
