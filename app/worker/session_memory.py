"""Session memory: the settings and ends of a place on disk, for the next time that a server opens it."""

import hashlib
from contextlib import suppress
from pathlib import Path

import msgspec

from nerfnav.core.files import replace_file
from nerfnav_app.state.session import SavedSession, Session


class SessionMemory:
    """Stored session of one place. Used by the UI loop's thread alone."""

    def __init__(self, folder: Path, what: str) -> None:
        """`folder` holds a file for each place, `what` is the scene or file that is opened."""
        self._what = what
        # a scene is known by its name, a file by where it is
        key = str(Path(what).resolve()) if Path(what).exists() else what
        self._file = folder / f"{hashlib.sha256(key.encode()).hexdigest()[:16]}.json"
        self._kept = self.last()

    def last(self) -> SavedSession | None:
        """Read the stored session; None where there is none, or an older version wrote it."""
        try:
            return msgspec.json.decode(self._file.read_bytes(), type=SavedSession)
        except (OSError, msgspec.MsgspecError):
            return None

    def follow(self, session: Session) -> None:
        """Store the session once the user has let go of all ends; without it the page starts with defaults."""
        settled = session.place is not None and not session.held and not session.seeking
        if session.what != self._what or not settled:
            return
        now = SavedSession(session.moment, session.viewed)
        if now == self._kept:
            return
        self._kept = now
        with suppress(OSError):
            self._file.parent.mkdir(parents=True, exist_ok=True)
            with replace_file(self._file) as stream:
                stream.write(msgspec.json.encode(now))
