"""Progress bar for long work after a run: a report, a checkpoint that is written or read."""

import contextlib
from collections.abc import Callable, Iterator
from typing import Any


@contextlib.contextmanager
def progress(comm: Any, words: str) -> Iterator[Callable[[float], None]]:
    """On rank 0, after two seconds: call what it gives with the part that is done, from 0 to 1."""
    from tqdm import tqdm
    with tqdm(total=1.0, desc=words, delay=2, disable=comm.rank != 0, leave=False,
              bar_format="{desc}: {percentage:3.0f}% |{bar}| {elapsed}") as bar:
        def done(part: float) -> None:
            bar.update(min(part, 1.0) - bar.n)
        yield done
