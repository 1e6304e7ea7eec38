"""A lock file that one process holds; the operating system releases it when the process ends, however it ends."""

import errno
import json
import logging
import os
import sys
from pathlib import Path
from typing import TextIO

logger = logging.getLogger(__name__)
WITHOUT_LOCKS = (errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOLCK)
"""What file systems answer that know no locks: shares of a NAS, some of clusters, folders over ssh."""
LOCK_BYTE = 1 << 20  # the byte of the lock file that is locked where a lock is of bytes


class FileLock:
    """A file that is locked while it is held and removed afterwards; its text names the holder.

    Parameters
    ----------
    path : Path
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._held: TextIO | None = None

    def take(self) -> bool:
        """Take the lock; return False if another process holds it.

        Raises
        ------
        OSError
            If the file cannot be written.
        """
        lock = self.path.open("a+", encoding="utf-8")
        try:
            if not _taken(lock) or not _is_open_at(lock, self.path):
                lock.close()
                return False
            lock.truncate(0)
            json.dump({"pid": os.getpid()}, lock)
            lock.flush()
        except BaseException:
            lock.close()
            raise
        self._held = lock
        return True

    def release(self) -> None:
        """Let go of the lock, if it is held."""
        if self._held is not None:
            if sys.platform == "win32":  # an open file cannot be removed there
                self._held.close()
            self.path.unlink(missing_ok=True)
            self._held.close()
            self._held = None

    def holder(self) -> str:
        """The holder of the lock, in words."""
        try:
            return f"process {int(json.loads(self.path.read_text(encoding='utf-8'))['pid'])}"
        except (OSError, ValueError, KeyError, TypeError):
            return "another run"


def _taken(lock: TextIO) -> bool:
    """Lock an open file for this process alone; return False if another holds it.

    This uses the operating system's lock and not a process number in the file, because the number of a killed run may
    belong to another program by now, and its start time moves when the clock is set. A file system without locks cannot
    tell whether another process writes there: the work goes on, as the user is not to be kept from it.
    """
    try:
        if sys.platform == "win32":
            import msvcrt

            lock.seek(LOCK_BYTE)  # beyond the text, which stays readable for the one who is refused
            msvcrt.locking(lock.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as cause:
        if cause.errno in (errno.EWOULDBLOCK, errno.EACCES, errno.EDEADLK):
            return False
        if cause.errno not in WITHOUT_LOCKS:
            raise
        logger.warning("%s: no locks in this file system, so that two runs in one folder are not kept apart", lock.name)
    return True


def _is_open_at(lock: TextIO, path: Path) -> bool:
    """Whether a path still names the open file: a run that ends removes it, and another may have made a new one."""
    try:
        return os.path.samestat(os.fstat(lock.fileno()), path.stat())
    except FileNotFoundError:
        return False
