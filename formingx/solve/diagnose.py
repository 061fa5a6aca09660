"""Finds out why a run could not go on: once, when it has failed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from ..discrete.elements import Body, body
from ..discrete.tooling import Tooling
from ..mesh.triangles import Place, place
from .diagnosis import Diagnosis
from .linear import DirectSolver, condition

_BEFORE, _SINGULAR = 10, 100.0
"""States before the last one at which the condition number of the tangent is looked at, too, and the growth from
there that tells of a singular tangent."""


class Attempt(NamedTuple):
    """Where a failed Newton iteration ended: x (own part) and control, and the last correction of both."""

    x: np.ndarray
    control: float
    dx: np.ndarray
    dcontrol: float


class Found(NamedTuple):
    """The worst of a failed attempt: residuals by field, the place and the node of the largest."""

    residual: dict[str, float]
    worst: Place
    point: np.ndarray


def diagnose(curve: Any, states: list, reason: str, attempt: Attempt | None = None, pace: str = "",
             target: float | None = None) -> Diagnosis:
    """Everything that the last good state and the failed attempt tell; collective.

    Args:
        curve: a `Curve`. states: the accepted ones, may be empty. attempt: None: no iteration failed.
        pace: what more is known if the run was ended in good health. target: of the control (the user's units), if that
            is what the run aims at.
    """
    problem = curve.problem
    x = problem.x.duplicate()
    last = states[-1] if states else None
    facts: dict[str, Any] = {"reason": reason, "step": len(states) if states else 0,
                             "control": problem.shown(last.control)[1] if last else 0.0,
                             "what": problem.shown(0.0)[0]}
    marks: list = []
    shape = None
    if last:
        x.array_w[:] = last.x
        shape = body(problem, x, last.control)
        if shape:
            facts |= _worst_of(problem, shape, marks)
    if attempt is not None:
        facts["aimed"] = problem.shown(attempt.control)[1]
        x.array_w[:] = attempt.x
        failed = body(problem, x, attempt.control)
        finite = failed is None or bool(np.isfinite(failed.J).all())
        if failed and finite:
            facts["failed_J"], facts["at_failed_J"], _ = _smallest_J(problem, failed)
        found = _residuals(problem, x, attempt.control)
        facts |= {"residual": found.residual, "worst": found.worst}
        if last:
            marks.append(("largest force left over", _moved(problem, last, found.point)))
        facts["flipped"] = _flips(problem, attempt)
    if last:
        facts["touching"] = problem.comm.allreduce(
            sum(int(np.sum(touch)) for touch in _touching(problem, last.x, last.control)), MPI.SUM)
        facts |= _tangents(curve, states)
    causes, advice = _verdict(facts, curve.fixed_control, pace, target)
    x.destroy()
    tooling = Tooling.of_problem(problem)
    tools = tooling.placed(tooling.travels(last.setting, last.control)) if last else []
    data = (problem.comm.rank, shape, marks, tools) if shape else None
    return Diagnosis(**facts, causes=tuple(causes), advice=tuple(advice), picture_data=data)


def _layer(problem: Any, tag: int) -> str:
    return next((name for name, t in problem.scene.mesh.layers.items() if t == tag), "")


def _smallest_J(problem: Any, shape: Body) -> tuple[float, Place, tuple]:
    at = np.unravel_index(int(np.argmin(shape.J)), shape.J.shape)
    return float(shape.J[at]), place(problem.scene.mesh, shape.points[at], _layer(problem, shape.layers[at[0]])), at


def _worst_of(problem: Any, shape: Body, marks: list) -> dict[str, Any]:
    """Smallest J, worst shape and nearness to a material's limit in the last good state."""
    J, where, at = _smallest_J(problem, shape)
    facts: dict[str, Any] = {"smallest_J": J, "at_J": where,
                             "shape": float((shape.quality / shape.at_rest).min())}
    marks.append((f"smallest J {J:.3g}", shape.moved[at]))
    limits = np.array([problem.scene.materials[_layer(problem, tag)].largest_I1 for tag in shape.layers])
    near = (shape.I1 - 3) / (limits[:, None] - 3)
    if np.isfinite(limits).any():
        at = np.unravel_index(int(np.argmax(near)), near.shape)
        facts["I1"] = float(near[at])
        facts["limit"] = place(problem.scene.mesh, shape.points[at], _layer(problem, shape.layers[at[0]]))
        marks.append(("nearest to the material's limit", shape.moved[at]))
    return facts


def _residuals(problem: Any, x: Any, control: float) -> Found:
    """The residual by field, over the support forces of the state, and where its largest displacement entry is."""
    out, comm, space = x.duplicate(), problem.comm, problem.forms.space
    problem.residual(x, control, out)
    values, n = out.array_r.copy(), space.dofmap.index_map.size_local
    out.destroy()
    vectors, numbers = space.sub(0).collapse()
    dofs = np.asarray(numbers, dtype=np.int64).reshape(-1, problem.forms.domain.geometry.dim)
    points = vectors.tabulate_dof_coordinates()[: len(dofs), :2]
    own = dofs[:, 0] < n
    dofs, points = dofs[own], points[own]
    is_u = np.zeros(n, dtype=bool)
    is_u[dofs.ravel()] = True
    parts = {"displacement": values[:n][is_u], "pressure": values[:n][~is_u], "multipliers": values[n:]}
    scale = problem.force_scale if np.isfinite(problem.force_scale) and problem.force_scale > 0 else 1.0
    residual = {}
    for name, part in parts.items():
        if comm.allreduce(len(part), MPI.SUM):
            total = comm.allreduce(float(np.sum(part**2)), MPI.SUM)
            residual[name] = float(np.sqrt(total)) / scale if np.isfinite(total) else np.inf
    sizes = np.nan_to_num(np.hypot(*values[dofs].T), nan=np.inf)
    mine = (float(sizes.max(initial=-1.0)), points[np.argmax(sizes)].tolist() if len(sizes) else [0.0, 0.0])
    point = np.array(max(comm.allgather(mine))[1])
    return Found(residual, place(problem.scene.mesh, point), point)


def _moved(problem: Any, state: Any, point: np.ndarray) -> np.ndarray:
    """Where a node at a reference point is in a state, shape (2,)."""
    vectors, numbers = problem.forms.space.sub(0).collapse()
    dofs = np.asarray(numbers, dtype=np.int64).reshape(-1, problem.forms.domain.geometry.dim)
    points = vectors.tabulate_dof_coordinates()[: len(dofs), :2]
    own = dofs[:, 0] < problem.forms.space.dofmap.index_map.size_local
    away = np.hypot(*(points[own] - point).T)
    at = int(np.argmin(away)) if len(away) else 0
    mine = (np.inf, [0.0, 0.0])
    if len(away):
        mine = (float(away[at]), (problem.forms.length * state.x[dofs[own][at]]).tolist())
    return point + np.array(min(problem.comm.allgather(mine))[1])


def _touching(problem: Any, x: np.ndarray, control: float) -> list[np.ndarray]:
    """For every contact: True for each own node in touch, shape (n,)."""
    return [c.touching(x[: problem.forms.space.dofmap.index_map.size_local], control) for c in problem.touching]


def _flips(problem: Any, attempt: Attempt) -> int | None:
    """Nodes whose contact changed in the last iteration; None without contact."""
    if not problem.touching:
        return None
    n, count = problem.forms.space.dofmap.index_map.size_local, 0
    before = attempt.x - attempt.dx, attempt.control - attempt.dcontrol
    for contact, a, b in zip(problem.touching, _touching(problem, *before),
                             _touching(problem, attempt.x, attempt.control), strict=True):
        slides = [contact.law.tractions(contact.positions(x[:n], c), contact.touch).sense
                  for x, c in (before, (attempt.x, attempt.control))]
        count += int(np.sum((a != b) | (a & b & (slides[0] != slides[1]))))
    return problem.comm.allreduce(count, MPI.SUM)


def _tangents(curve: Any, states: list) -> dict[str, Any]:
    """Condition and signs of the determinant along the path, and the limit point that the last slopes point to.

    A limit point is where the determinant of dF/dx changes its sign and the control is stationary; where it changes
    without that, another branch starts. The sign at two states says whether there was an odd number of changes
    between them; bisection finds one.
    """
    problem = curve.problem
    solver = DirectSolver(problem.matrix, problem.symmetric, determinant=True)

    def sign(state):
        with problem.at(state):
            problem.tangent(problem.x, state.control)
            return solver.sign() if solver.factorise() else 0

    limits = tuple(problem.shown(s.control)[1] for s in states if s.kind == "limit point")
    facts: dict[str, Any] = {"limit_points": limits}
    turned = []
    usable = [s for s in states[1 if problem.forms.slack_at_rest else 0:] if s.kind != "limit point"]
    if sign(states[-1]):
        facts["condition"] = condition(problem.matrix, solver)
    if len(usable) > _BEFORE and sign(usable[-1 - _BEFORE]):
        facts["condition_before"] = condition(problem.matrix, solver)
    if len(usable) > 1 and not problem.has_history:
        # one sign per stretch between limit points: there it cannot change unless another branch starts
        turned = _changes(states, usable, sign)
    facts["turned"] = tuple((problem.shown(a.control)[1], problem.shown(b.control)[1]) for a, b in turned)
    solver.destroy()
    if len(states) > 2:
        a, b = states[-2:]
        slopes = [curve.unit_slope(s) for s in states]
        drop = slopes[-2]**2 - slopes[-1]**2              # slope^2 falls in proportion to the control left
        if drop > 0 and slopes[-2] * slopes[-1] > 0 and abs(slopes[-1]) < 0.3 * max(map(abs, slopes)):
            ahead = b.control + (b.control - a.control) * slopes[-1]**2 / drop
            facts["limit_ahead"] = problem.shown(ahead)[1]
    return facts


def _changes(states: list, usable: list, sign: Any) -> list[tuple]:
    """Neighbours between which the sign of the determinant changed though the control has no limit point there."""
    pieces: list[list] = [[]]
    for state in states:
        if state.kind == "limit point":
            pieces.append([])
        elif any(state is s for s in usable):
            pieces[-1].append(state)
    found = []
    for piece in pieces:
        low, high = 0, len(piece) - 1
        if high < 1:
            continue
        first, last = sign(piece[low]), sign(piece[high])
        if first * last >= 0:
            continue
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if sign(piece[middle]) * first > 0 else (low, middle)
        if piece[low].slope * piece[high].slope > 0:
            found.append((piece[low], piece[high]))
    return found


def _verdict(facts: dict, fixed_control: bool, pace: str, target: float | None) -> tuple[list[str], list[str]]:
    """What the numbers prove or make likely, and what to try."""
    found = [*_of_material(facts), *_of_elements(facts), *_of_limits(facts, fixed_control, target),
             *_of_branches(facts), *_of_numbers(facts)]
    if pace and not found:
        found.append((pace, "more max_steps"))
    return [cause for cause, _ in found], list(dict.fromkeys(advice for _, advice in found))


def _of_material(facts: dict) -> Iterator[tuple[str, str]]:
    """(cause, advice) of a material near the end of its domain."""
    if (facts.get("I1") or 0) > 0.8:
        yield (f"a material is near the end of its domain: I1 - 3 is {100 * facts['I1']:.3g} % of what its limit"
               f" allows at {facts['limit']}",
               "a target that needs less stretch there, a larger limit of the material, or shorter steps"
               " (StepControl(largest=...))")


def _of_elements(facts: dict) -> Iterator[tuple[str, str]]:
    """(cause, advice) of an element that turns inside out."""
    J, failed_J = facts.get("smallest_J"), facts.get("failed_J")
    infinite = any(np.isinf(v) for v in facts.get("residual", {}).values())
    inverted = failed_J is not None and failed_J <= 0
    if J is not None and (J < 0.3 or facts["shape"] < 0.1 and (inverted or infinite)):
        now = f"J = {J:.3g}" if J < 0.3 else f"its shape is {facts['shape']:.2g} of what it was at rest"
        R, Z = facts["at_J"].R, facts["at_J"].Z
        yield (f"an element is about to turn inside out: {now} in the last good state, at {facts['at_J']}"
               + (f" (in the failed attempt J = {failed_J:.3g})" if inverted else ""),
               f"smaller elements around (R, Z) = ({R:.4g}, {Z:.4g}), in a disc with concentrate={{{R:.4g}: 0.2}}, or"
               f" elements that start long in the direction in which they are squeezed there")


def _of_limits(facts: dict, fixed_control: bool, target: float | None) -> Iterator[tuple[str, str]]:
    """(cause, advice) of a limit point before the target."""
    what, limits = facts["what"], facts.get("limit_points", ())
    if target is not None and limits and abs(target) > max(map(abs, limits)):
        yield (f"the {what} has its maximum, {max(limits, key=abs):.6g}, at a limit point that was passed, and"
               f" {target:.6g} lies beyond it",
               "a target that grows beyond a limit point (pole_height, pole_stretch, enclosed_volume)")
    ahead, aimed = facts.get("limit_ahead"), facts.get("aimed")
    if ahead is not None and fixed_control:
        yield (f"a limit point lies ahead: the {what} can rise no further than about {ahead:.6g}, as the slope"
               f" of the path tells" + (f"; {aimed:.6g} was asked for" if aimed is not None else ""),
               "`trace`, which passes limit points, or a lower target")


def _of_branches(facts: dict) -> Iterator[tuple[str, str]]:
    """(cause, advice) of another branch, and of contact that does not settle."""
    what = facts["what"]
    for a, b in facts.get("turned", ()):
        yield (f"the tangent lost definiteness between {what} {a:.6g} and {b:.6g} without a limit point: another"
               f" branch starts there, possibly buckling",
               f"a small imperfection in the load or the mesh, or a target before {what} {b:.6g}")
    if _singular(facts) and not facts.get("turned") and facts.get("limit_ahead") is None:
        yield (f"the tangent becomes singular, and there is no limit point: its condition number has grown from"
               f" {facts['condition_before']:.1g} to {facts['condition']:.1g} in {_BEFORE} states; another branch"
               f" starts here, where the body buckles or a point of contact is about to slip away",
               "smaller elements; contact at points=4 (Contact), where there is any")
    if facts.get("flipped"):
        yield (f"contact does not settle: {facts['flipped']} nodes changed state in the last iteration",
               "smaller elements along the face in contact, contact at points=4, a wider ramp or a lower penalty"
               " (Contact)")


def _singular(facts: dict) -> bool:
    """True if the tangent is near a singular one: its condition has grown from state to state."""
    before = facts.get("condition_before")
    return bool(before and (facts.get("condition") or 0) > _SINGULAR * before)


def _of_numbers(facts: dict) -> Iterator[tuple[str, str]]:
    """(cause, advice) of round-off."""
    if (facts.get("condition") or 0) > 1e14 and not _singular(facts):
        yield (f"round-off: the condition number of the tangent is {facts['condition']:.1g}, next to nothing of"
               f" 16 digits is left",
               "a larger eps, a lower contact penalty, or layers less different in stiffness")
