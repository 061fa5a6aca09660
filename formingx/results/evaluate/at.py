"""A problem as it was at a state of a path, for evaluation; its history is put back afterwards."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import numpy as np


@contextlib.contextmanager
def at(path: Any, state: Any) -> Iterator[np.ndarray]:
    """The owned unknowns of a state, shape (n,), the problem of the path being in that state."""
    problem = path.problem
    path.go_to(state)
    now, problem.memory = problem.memory, state.memory
    try:
        problem.x.array_w[:] = state.x
        problem.set_state(problem.x, state.control)
        yield state.x[: problem.forms.space.dofmap.index_map.size_local]
    finally:
        problem.memory = now
