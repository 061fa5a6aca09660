"""Whether the tools of a process can move as its stages say."""

from __future__ import annotations

from typing import Any


def check(scene: Any, plans: Any) -> None:
    pass
