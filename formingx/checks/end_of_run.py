"""Checks at the end of a run: its last state, its jumps, the contact with its tools."""

from collections.abc import Iterator
from typing import Any

from ..findings import Finding, register
from ..results.evaluate import edges, resticking, snaps, tension, volume


@register("end")
def inadmissible(path: Any) -> Iterator[Finding]:
    """Report the first inadmissible state of a `Path` (`State.verdict`)."""
    bad = next((state for state in path.states if state.verdict), None)
    if bad is not None:
        yield Finding("serious", "state", f"from {path.describe(bad)} on the results must not be used: {bad.verdict}")


@register("end")
def volumes(path: Any) -> Iterator[Finding]:
    """Report elements of a `Path` that do not keep their volumes in its last state; collective."""
    error = path.last.measures["volume_error"]
    yield from volume.findings(error, "the last state", volume.away_from_clamps(path) if error > volume.BOUND else None)
    yield from volume.extreme_ratio(path)


@register("end")
def contact(path: Any) -> Iterator[Finding]:
    """Report faults of the contact in a `Path`; collective.

    They are penetration that changes tool forces, coarse elements at edges of tools, and sticking points that separate
    and stick again elsewhere.
    """
    yield from path.admissibility.findings(path.last)
    yield from edges.findings(edges.coarsest(path, path.last))
    yield from resticking.findings(resticking.furthest(path))


@register("end")
def equilibrium(path: Any) -> Iterator[Finding]:
    """Report a membrane in compression, and snap-through that changes the wall, in a `Path`; collective."""
    yield from tension.findings(tension.first_compression(path))
    yield from snaps.findings(snaps.largest(path))
