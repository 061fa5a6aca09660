"""Progress bar for long tasks after a run: a report, or a checkpoint that is written or read."""

import contextlib
import sys
from collections.abc import Callable, Iterator
from typing import Any


@contextlib.contextmanager
def progress(comm: Any, words: str) -> Iterator[Callable[[float], None]]:
    """Show a progress bar on rank 0 after two seconds; yields the function that sets the fraction, 0 to 1."""
    from tqdm import tqdm
    seen = sys.stderr.isatty() or "ipykernel" in sys.modules             # no bar in a log file
    with tqdm(total=1.0, desc=words, delay=2, disable=comm.rank != 0 or not seen, leave=False,
              bar_format="{desc}: {percentage:3.0f}% |{bar}| {elapsed}") as bar:
        def done(part: float) -> None:
            bar.update(min(part, 1.0) - bar.n)
        yield done
