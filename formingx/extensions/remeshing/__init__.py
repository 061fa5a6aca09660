"""Remeshing of deformed bodies during a run."""

from typing import Any

from ...problem.problem import Problem
from ...results.files.checkpoint import register_mesh_loader
from ...solve.state import State
from . import files
from .remeshing import Remesh
from .state_transfer import StateTransfer


def _load(problem: Problem, last: State, data: dict[str, Any]) -> Problem:
    """Return the problem on the next mesh of a remeshed run, from the data of `files.save` in a checkpoint."""
    return files.load((problem, last), data, StateTransfer)


register_mesh_loader(_load)
