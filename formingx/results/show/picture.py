"""Picture or animation in a file, which a notebook shows."""

import base64
import os
from pathlib import Path
from typing import Any


class Picture(os.PathLike):
    """Picture (.png) or animation (.gif, .mp4) in a file; a notebook shows the present content of the file.

    Args:
        file: name of the file.

    Attributes:
        file: path of the file (`pathlib.Path`).
    """

    def __init__(self, file: Any):
        self.file = Path(file)

    def __fspath__(self) -> str:
        return os.fspath(self.file)

    def __repr__(self) -> str:
        return f"Picture({os.fspath(self.file)!r})"

    def _repr_mimebundle_(self, **_: Any) -> dict[str, str]:
        if not self.file.is_file():                          # on other ranks, for one
            return {}
        data, kind = base64.b64encode(self.file.read_bytes()).decode(), self.file.suffix[1:].lower()
        if kind == "png":
            return {"image/png": data}
        source = f'src="data:{"video" if kind == "mp4" else "image"}/{kind};base64,{data}" style="max-width: 100%"'
        return {"text/html": f"<video controls loop {source}></video>" if kind == "mp4" else f"<img {source}>"}
