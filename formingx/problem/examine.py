"""Examination of a body after a failed attempt: worst elements, distance from limits, residual."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from mpi4py import MPI

from ..contact.tooling import Tooling
from ..errors import InputError
from ..figures.deformed import draw_volume_ratios
from ..forms.elements import Body, body
from ..mesh.nodes import dof_positions
from ..mesh.triangles import Place, place

_COMPRESSED_STRETCH = 0.9       # stretch along the section below which a sheet is compressed
_MIN_COLUMNS = 3           # smallest number of columns of elements of a compressed piece


class Examination:
    """Examination of the last good state, or None, and of a failed attempt; collective.

    The attempt is the last iterate of the failed Newton iteration (x, control, last corrections dx and dcontrol), or
    None. facts: {field of a `Diagnosis`: its value}.
    """

    def __init__(self, problem: Any, last: Any, attempt: Any):
        self.facts: dict[str, Any] = {}
        self._problem, self._last = problem, last
        self._elements: Body | None = None
        self._marks: list[tuple[str, np.ndarray]] = []
        x = problem.x.duplicate()
        if last is not None:
            x.array_w[:] = last.x
            self._elements = body(problem, x, last.control)
            self.facts["touching"] = problem.comm.allreduce(
                sum(int(np.sum(touch)) for touch in _touching(problem, last.x, last.control)), MPI.SUM)
            if self._elements:
                self._find_worst(self._elements)
                self._find_compressed(self._elements)
        if attempt is not None:
            self._examine_attempt(x, attempt)
        x.destroy()
        self._tools: list = []
        if last is not None:
            tooling = Tooling.of_problem(problem)
            self._tools = tooling.placed(tooling.travels(last.setting, last.control))

    def _find_worst(self, elements: Body) -> None:
        """Store smallest J, worst shape and largest (I1 - 3)/limit, with I1 = tr F^T F, of elements in `facts`."""
        problem, facts = self._problem, self.facts
        facts["smallest_J"], facts["at_J"], at = _smallest_J(problem, elements)
        facts["shape"] = float((elements.quality / elements.initial_quality).min())
        self._marks.append((f"smallest J {facts['smallest_J']:.3g}", elements.deformed_points[at]))
        limits = np.array([problem.scene.materials[_layer(problem, tag)].largest_I1 for tag in elements.layers])
        near = (elements.I1 - 3) / (limits[:, None] - 3)
        if np.isfinite(limits).any():
            at = np.unravel_index(int(np.argmax(near)), near.shape)
            facts["I1"] = float(near[at])
            facts["limit"] = place(problem.scene.mesh, elements.points[at], _layer(problem, elements.layers[at[0]]))
            self._marks.append(("nearest to the material's limit", elements.deformed_points[at]))

    def _find_compressed(self, elements: Body) -> None:
        """Store mean stretch and ends of the longest part compressed along its section in `facts["shortened"]`."""
        columns = self._problem.scene.mesh.columns
        if columns is None:
            return
        line = columns.place(columns.ends).mean(0)           # through the middles of the rows' nodes
        middles, tangents = (line[1:] + line[:-1]) / 2, np.diff(line, axis=0)
        lengths = np.linalg.norm(tangents, axis=1)
        tangents /= lengths[:, None]
        nearest = np.array([np.argmin(np.hypot(*(middles - centre).T)) for centre in elements.points.mean(1)])
        stretch = np.linalg.norm(np.einsum("mkij,mj->mki", elements.section, tangents[nearest]), axis=-1).mean(1)
        number = np.bincount(nearest, minlength=len(middles))
        found = np.bincount(nearest, stretch, len(middles)) / np.maximum(number, 1)
        short = np.flatnonzero((found > 0) & (found < _COMPRESSED_STRETCH))
        pieces = [k for k in np.split(short, np.flatnonzero(np.diff(short) > 1) + 1) if len(k) >= _MIN_COLUMNS]
        if pieces:
            piece = max(pieces, key=lambda k: lengths[k].sum())
            self.facts["shortened"] = (float(found[piece] @ lengths[piece] / lengths[piece].sum()),
                                       tuple(line[piece[0]].tolist()), tuple(line[piece[-1] + 1].tolist()))

    def _examine_attempt(self, x: Any, attempt: Any) -> None:
        """Store smallest J, residual and number of status changes of the failed attempt in `facts`; x: work vector."""
        problem, facts = self._problem, self.facts
        x.array_w[:] = attempt.x
        failed = body(problem, x, attempt.control)
        if failed and bool(np.isfinite(failed.J).all()):
            facts["failed_J"], facts["at_failed_J"], _ = _smallest_J(problem, failed)
        facts["residual"], facts["worst"], point = _residuals(problem, x, attempt.control)
        if self._last is not None and self._elements:
            self._marks.append(("largest out-of-balance force", _deformed_position(problem, self._last, point)))
        facts["flipped"] = _status_changes(problem, attempt)

    def draw(self, file: Any, title: str) -> None:
        """Draw the last good state with J, worst points and tools on rank 0; a membrane, or none, is an InputError."""
        if self._elements is None:
            raise InputError("Diagnosis.picture: there are no elements to draw: a membrane has none across its"
                             " thickness, and without a good state there is no shape")
        if self._problem.comm.rank == 0:
            os.makedirs(os.path.dirname(os.path.abspath(file)), exist_ok=True)
            draw_volume_ratios(self._elements, self._marks, self._tools, title, file)


def _layer(problem: Any, tag: int) -> str:
    """Return the name of the layer with a tag of the mesh; "" if there is none."""
    return next((name for name, t in problem.scene.mesh.layers.items() if t == tag), "")


def _smallest_J(problem: Any, elements: Body) -> tuple[float, Place, tuple]:
    """Return the smallest J, its place in the mesh, and its index in `elements.J`."""
    at = np.unravel_index(int(np.argmin(elements.J)), elements.J.shape)
    layer = _layer(problem, elements.layers[at[0]])
    return float(elements.J[at]), place(problem.scene.mesh, elements.points[at], layer), at


def _residuals(problem: Any, x: Any, control: float) -> tuple[dict[str, float], Place, np.ndarray]:
    """Return the residual of each field, and the `Place` and position (R, Z), length, of the largest residual force.

    Residuals are {"displacement", "pressure" or "multipliers": norm over the norm of the support forces}.
    """
    out, comm = x.duplicate(), problem.comm
    problem.residual(x, control, out)
    values, n = out.array_r.copy(), problem.n_owned
    out.destroy()
    dofs, points = _own_nodes(problem)
    is_u = np.zeros(n, dtype=bool)
    is_u[dofs.ravel()] = True
    parts = {"displacement": values[:n][is_u], "pressure": values[:n][~is_u], "multipliers": values[n:]}
    scale = problem.force_scale if np.isfinite(problem.force_scale) and problem.force_scale > 0 else 1.0
    residual = {}
    for name, part in parts.items():
        if comm.allreduce(len(part), MPI.SUM):
            total = comm.allreduce(float(np.sum(part**2)), MPI.SUM)
            residual[name] = float(np.sqrt(total)) / scale if np.isfinite(total) else np.inf
    sizes = np.nan_to_num(np.linalg.norm(values[dofs], axis=1), nan=np.inf)
    at = points[np.argmax(sizes)].tolist() if len(sizes) else [0.0] * points.shape[1]
    mine = (float(sizes.max(initial=-1.0)), at)
    point = np.array(max(comm.allgather(mine))[1])
    return residual, place(problem.scene.mesh, point), point


def _own_nodes(problem: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the displacement unknowns and reference positions, length, of owned nodes, shape (n, components) both."""
    vectors, numbers = problem.forms.space.sub(0).collapse()
    dofs = np.asarray(numbers, dtype=np.int64).reshape(-1, problem.forms.domain.geometry.dim)
    own = dofs[:, 0] < problem.n_owned
    return dofs[own], dof_positions(vectors)[: len(dofs)][own]


def _deformed_position(problem: Any, state: Any, point: np.ndarray) -> np.ndarray:
    """Return the deformed position in a state of the node at a reference point, shape (2,), length."""
    dofs, points = _own_nodes(problem)
    away = np.linalg.norm(points - point, axis=1)
    at = int(np.argmin(away)) if len(away) else 0
    mine = (np.inf, [0.0] * len(point))
    if len(away):
        mine = (float(away[at]), (problem.forms.length * state.x[dofs[at]]).tolist())
    return point + np.array(min(problem.comm.allgather(mine))[1])


def _touching(problem: Any, x: np.ndarray, control: float) -> list[np.ndarray]:
    """Return the masks of the locally owned points in contact, shape (n,), for every active contact."""
    return [c.touching(x[: problem.n_owned], control) for c in problem.contact.faces]


def _status_changes(problem: Any, attempt: Any) -> int | None:
    """Return the number of points whose contact status changed in the last iteration; None without contact.

    attempt: the last iterate x and control, with their last corrections dx and dcontrol.
    """
    if not problem.contact.faces:
        return None
    n, count = problem.n_owned, 0
    before = attempt.x - attempt.dx, attempt.control - attempt.dcontrol
    for contact, a, b in zip(problem.contact.faces, _touching(problem, *before),
                             _touching(problem, attempt.x, attempt.control), strict=True):
        slides = [contact.law.tractions(contact.positions(x[:n], c), contact.history).sense
                  for x, c in (before, (attempt.x, attempt.control))]
        count += int(np.sum((a != b) | (a & b & (slides[0] != slides[1]))))
    return problem.comm.allreduce(count, MPI.SUM)
