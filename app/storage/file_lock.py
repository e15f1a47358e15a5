"""File lock: a lock file beside a file that is being written, which the system frees when a program is killed."""

from pathlib import Path

from filelock import BaseFileLock, FileLock, Timeout


def lock_for(path: Path) -> BaseFileLock:
    """The lock of a file that is written for a while, FILE.lock beside it, not taken yet.

    Taking it raises filelock.Timeout, an OSError, at once where it is held.
    """
    return FileLock(path.with_name(f"{path.name}.lock"), blocking=False, thread_local=False)


def is_locked(path: Path) -> bool:
    """Check whether a process is writing a file; False too where its lock may not be opened."""
    lock = lock_for(path)
    if not Path(lock.lock_file).is_file():
        return False
    try:
        with lock:
            return False
    except Timeout:
        return True
    except OSError:
        return False
