"""Run the code blocks of a page, put their output below them and store the pictures that the page shows.

    ./fx python3 docs/run_page.py docs/tutorials/inflate.md ...

A block of the language `text` right after a block of Python is its output. It is replaced, unless it agrees with the
printed text to the digits shown (`...` stands for anything). Pictures in a folder `pictures` beside the page are those
that a block writes under the same name.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import re
import sys
import tempfile
import time
from pathlib import Path

from PIL import Image

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from printed import assert_shows  # noqa: E402

BLOCK = re.compile(r"(```python\n(.*?)```)(?:\n\n```text\n(.*?)```)?", re.S)
PICTURE = re.compile(r"\]\(pictures/(\w+\.png)\)")


def store(picture: Path, file: Path) -> None:
    """Store a picture with at most 560 pixels a side and 256 colours."""
    with Image.open(picture) as image:
        image.thumbnail((560, 560))
        image.convert("RGB").quantize(256, kmeans=2).save(file, optimize=True)


def rewrite(page: Path) -> None:
    """Run a page in a temporary folder; rewrite it and its pictures."""
    text, names, home, seconds = page.read_text(), {}, Path.cwd(), []

    def put(match: re.Match[str]) -> str:
        code, source, shown = match.groups()
        start = time.process_time()
        with contextlib.redirect_stdout(io.StringIO()) as output:
            exec(compile(source, page.name, "exec"), names)
        seconds.append(time.process_time() - start)
        printed = output.getvalue()
        with contextlib.suppress(AssertionError):
            assert_shows(shown or "", printed)
            return match[0]
        return f"{code}\n\n```text\n{printed.strip()}\n```"

    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        new = BLOCK.sub(put, text)
        print(f"{page}: {sum(seconds):.1f} s of processor time, blocks", *(f"{each:.1f}" for each in seconds))
        os.chdir(home)
        page.write_text(new)
        for name in sorted(set(PICTURE.findall(text))):
            store(Path(folder) / name, page.parent / "pictures" / name)


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("pages", type=Path, nargs="+")
    for file in options.parse_args().pages:
        rewrite(file)
