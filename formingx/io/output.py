"""Files that are written whole or not at all."""

import contextlib
import os
import shutil
import stat
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..errors import place


def replace(file: Any, write: Callable[[Any], Any], mode: str = "w") -> None:
    """Write beside the file, then rename: an earlier file survives a failure, and its mode and owner stay.

    Symbolic links are followed. An existing device or pipe is written to directly.

    Raises:
        OSError: the file cannot be written; it names the file, and no part is left behind.
    """
    file = place("file", file)
    target = Path(os.path.realpath(file))
    part = target.with_name(f"{target.name}.{os.getpid()}.part")
    how: dict[str, Any] = {} if "b" in mode else {"newline": "", "encoding": "utf-8"}
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        there = target.stat() if target.exists() else None
        if there and not stat.S_ISREG(there.st_mode):
            with tempfile.TemporaryFile(f"{mode}+", **how) as whole, open(target, mode, **how) as stream:
                write(whole)
                whole.seek(0)
                shutil.copyfileobj(whole, stream)
            return
        with open(part, mode, **how) as stream:
            write(stream)
        if there:
            with contextlib.suppress(PermissionError):
                os.chown(part, there.st_uid, there.st_gid)
            os.chmod(part, stat.S_IMODE(there.st_mode))
        os.replace(part, target)
    except BaseException as error:
        with contextlib.suppress(OSError):
            part.unlink()
        if isinstance(error, OSError):
            raise OSError(error.errno, f"{os.fspath(file)!r} could not be written: {error.strerror}") from None
        raise
