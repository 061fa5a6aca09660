"""Checks of the tools of a run: tools that were never touched, and moulds from which the body moved away."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from mpi4py import MPI

from ..contact.tooling import Tooling
from ..findings import Finding, register
from ..ranks import combined
from ..values.tolerances import ROUND_OFF
from .mould_side import moulds


@register("end")
def untouched(path: Any) -> Iterator[Finding]:
    """Yield warnings on tools never touched and moulds that the body left, but not of remeshed runs; collective."""
    segment = path.record.segments[-1]
    problem, states = segment.problem, segment.states
    if len(path.record.segments) > 1 or len(states) < 2:            # after remeshing the earlier states are missing
        return
    mould_contacts = moulds(problem.scene)
    names = Tooling.of_problem(problem).names
    for name in dict.fromkeys(names):
        contacts = [contact for contact, tool in zip(problem.contacts, names, strict=True) if tool == name]
        items = {i for i, item in enumerate(problem.scene.items) if any(item is c.contact for c in contacts)}
        active = [state for state in states if not items <= set(state.setting.get("inactive", ()))]
        if len(active) < 2:
            continue
        touched = any(_touches(problem, state, contacts) for state in _states_with_contact(path, active[1:], name))
        start, end = (_distances(problem, state, contacts) for state in (active[0], active[-1]))
        law, tool = contacts[0].contact, contacts[0].contact.name or contacts[0].contact.on
        near = ROUND_OFF * contacts[0].thickness
        first, last = (0.0 if abs(gap) < near else gap for gap in (start.min(), end.min()))
        gaps = f"the gap was {first:.4g} at first and {last:.4g} at the end"
        if law.direction is None and any(entry.contact in mould_contacts for entry in contacts) and \
                end.mean() > start.mean() + contacts[0].thickness:
            yield Finding("warning", tool, f"the body moved away from this mould: the mean distance of its face"
                          f" {law.on!r} grew from {start.mean():.4g} to {end.mean():.4g}. Does the pressure act on the"
                          f" other face, and has it the right sign?")
        elif not touched and law.direction is not None:
            column = problem.scene.column(law) if law in problem.scene.drivable else ""
            travels = [state.measures[column] for state in active if column in state.measures]
            travel = f" of {max(travels, key=abs):.4g}" if travels else ""
            yield Finding("warning", tool, f"this tool met nothing on its travel{travel}: {gaps}. A travel above 0 is"
                          f" along direction = ({', '.join(f'{m:g}' for m in law.direction)}); place the tool nearer,"
                          f" or turn its direction")
        elif not touched:
            yield Finding("warning", tool, f"the body never touched this tool: {gaps}")


def _states_with_contact(path: Any, states: list[Any], name: str) -> list[Any]:
    """Return states to examine a tool's contact in: the last one with a force first, then those with touch."""
    column = Tooling.of_problem(path.problem).force_columns.get(name, "")
    forced = [state for state in states if state.measures.get(column)]
    touching = [state for state in states if state.measures.get("contact_length", state.measures.get("contact_area"))]
    return [*forced[::-1], *touching[::-1]]


def _touches(problem: Any, state: Any, contacts: list[Any]) -> bool:
    """Return True if the force between a tool and the given `FaceContact` objects exceeds round-off; collective."""
    def force(contact: Any) -> float:
        """Return the sum of the magnitudes of the normal forces at the contact points."""
        normal = contact.tractions(state.x, state.control).normal
        return float(combined(problem.comm, float(contact.rule.area @ np.abs(normal)), MPI.SUM))

    with problem.state_context(state):
        return any(force(contact) > ROUND_OFF * contact.force_scale for contact in contacts
                   if contact in problem.contact.faces)


def _distances(problem: Any, state: Any, contacts: list[Any]) -> np.ndarray:
    """Return gaps at contact points of `FaceContact` objects, shape (n,), length, negative inside a tool; collective.

    The points of all ranks are included, except those of prescribed position (a rim held on a flange touches nothing),
    unless there are no others.
    """
    with problem.state_context(state):
        gaps = [-contact.contact.tool.signed_distance(contact.positions(state.x, state.control))
                for contact in contacts]
        free = [~np.isin(contact.rule.dofs, problem.constrained).all(1) for contact in contacts]
    all_gaps, kept = (np.concatenate([part for parts in problem.comm.allgather(arrays) for part in parts])
                      for arrays in (gaps, free))
    return all_gaps[kept] if kept.any() else all_gaps
