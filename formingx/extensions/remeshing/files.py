"""Checkpoints of remeshed runs: a mesh made during the run, and the data transferred to it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...errors import InputError
from ...mesh.grid import Grid, gathered, to_mesh
from ...problem.problem import Problem
from ...results.files.description import describe, differences
from ...solve.state import State
from .earlier_meshes import scene_on_new_mesh


def save(problem: Any) -> dict[str, Any]:
    """Return checkpoint data of a mesh of a remeshed run for `load`, with nodes and cells in order; on one rank."""
    mesh = problem.scene.mesh
    grid, nodes = gathered(mesh), np.asarray(mesh.domain.geometry.input_global_indices, dtype=np.int64)
    number = mesh.domain.topology.original_cell_index
    points = np.empty_like(grid.points)
    points[nodes] = grid.points
    layers = {name: nodes[rows[np.argsort(number[mesh.cells.find(mesh.layers[name])])]]
              for name, rows in grid.layers.items()}
    state_transfer = problem.scene.state_transfer._replace(before=None)
    return {"points": points, "layers": layers, "boundaries": {name: nodes[r] for name, r in grid.boundaries.items()},
            "preformed": state_transfer._asdict(), "shifts": [c.shift for c in problem.contacts],
            "scene": describe(problem)["mesh"]}


def load(before: tuple[Problem, State], data: dict[str, Any], state_transfer: Callable[..., Any]) -> Problem:
    """Return the problem on a mesh made during a run; several ranks or another numbering are an InputError."""
    scene = before[0].scene
    if scene.mesh.comm.size > 1:
        raise InputError("load: a remeshed run can be loaded on one rank only")
    points = np.array(data["points"])
    grid = Grid(points, np.arange(1, len(points) + 1), {k: np.array(v) for k, v in data["layers"].items()},
                {k: np.array(v) for k, v in data["boundaries"].items()})
    mesh = to_mesh(lambda: grid, scene.mesh.comm, "checkpoint: its mesh")
    made = Problem(scene_on_new_mesh(mesh, state_transfer(**data["preformed"])._replace(before=before)))
    for contact, shift in zip(made.contacts, data["shifts"], strict=True):
        if shift is not None:
            contact.shift_distances(np.array(shift))
    if found := list(differences(data["scene"], describe(made)["mesh"])):
        raise InputError(f"checkpoint: its mesh came out with another numbering here: {found[0]}")
    return made
