"""Files that are written whole or not at all."""

import contextlib
import os
import shutil
import stat
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..errors import file_path


def replace(file: Any, write: Callable[[Any], Any], mode: str = "w") -> None:
    """Write a file under a temporary name, then rename it, so that no other program reads an incomplete file.

    `write` writes to a stream, "w" for text or "wb" for bytes. If it fails, the earlier file is kept, and an OSError
    names the file. Mode and owner are kept, links followed, devices written directly.
    """
    file = file_path("file", file)
    target = Path(os.path.realpath(file))
    temporary = target.with_name(f"{target.name}.{os.getpid()}.part")
    options: dict[str, Any] = {} if "b" in mode else {"newline": "", "encoding": "utf-8"}
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        earlier = target.stat() if target.exists() else None
        if earlier and not stat.S_ISREG(earlier.st_mode):
            with tempfile.TemporaryFile(f"{mode}+", **options) as buffer, open(target, mode, **options) as stream:
                write(buffer)
                buffer.seek(0)
                shutil.copyfileobj(buffer, stream)
            return
        with open(temporary, mode, **options) as stream:
            write(stream)
        if earlier:
            with contextlib.suppress(PermissionError):
                os.chown(temporary, earlier.st_uid, earlier.st_gid)
            os.chmod(temporary, stat.S_IMODE(earlier.st_mode))
        os.replace(temporary, target)
    except BaseException as error:
        with contextlib.suppress(OSError):
            temporary.unlink()
        if isinstance(error, OSError):
            raise OSError(error.errno, f"{os.fspath(file)!r} could not be written: {error.strerror}") from None
        raise
