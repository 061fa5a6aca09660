"""The progress bar of a run."""

from __future__ import annotations

from typing import Any


def progress_bar(comm: Any, words: str, progress: bool) -> Any:
    """A bar from 0 to 1 on rank 0, after two seconds; none without `progress`."""
    from tqdm import tqdm
    return tqdm(total=1.0, desc=words, delay=2, disable=not progress or comm.rank != 0, leave=False,
                bar_format="{desc}: {percentage:3.0f}% |{bar}| {elapsed}{postfix}")


def show(bar: Any, gained: float, states: int) -> None:
    """How far a run has come, and in how many states."""
    if not bar.disable:
        bar.n = min(max(gained, 0.0), 1.0)
        bar.set_postfix_str(f"state {states}", refresh=False)
        bar.update(0)
