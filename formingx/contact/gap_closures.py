"""Arc lengths at which open points on straight paths reach their tools, computed in C for tools of lines and arcs.

The prediction of contact events asks hundreds of times in a run, for few points each time.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .._jit import CFunctions

_C = CFunctions("contact/gap_closures.c")


def gap_closures(law: Any, start: np.ndarray, velocity: np.ndarray, free: np.ndarray, length: float) -> np.ndarray:
    """Return the arc length at which the gap of each point closes, shape (n,); `length` if it stays open.

    It is `length`, too, for points outside the mask `free`, shape (n,), which are closed. start, velocity: positions
    relative to the tool and d/ds, shape (n, c), length. Contact begins at the signed distance -theta, positive inside;
    theta is the half-width of the contact ramp.
    """
    arc_lengths, profile = np.full(len(start), float(length)), law.profile
    if profile is not None:
        _C.gap_closures(len(start), start, velocity, free, 16, length / 16, law.theta, law.shift, np.ndim(law.shift),
                        len(profile.table), profile.lines, profile.table, arc_lengths)
        return arc_lengths
    at = length / 16 * np.arange(17)
    travels = 1.01 * length * np.linalg.norm(velocity, axis=1)             # bound of the approach of each point
    near = np.flatnonzero(free & (law.distance(start) + travels > -law.theta))
    if len(near):
        gap = -law.theta - law.part(near).distance(start[near] + at[:, None, None] * velocity[near])    # shape (17, m)
        hit = np.flatnonzero((gap[1:] <= 0).any(0))
        k = np.argmax(gap[1:, hit] <= 0, axis=0)
        before, now = np.maximum(gap[k, hit], 0.0), gap[k + 1, hit]
        share = np.divide(before, before - now, out=np.zeros(len(hit)), where=before > 0)
        arc_lengths[near[hit]] = at[k] + (at[k + 1] - at[k]) * share
    return arc_lengths


def crossing(law: Any, i: int, x: np.ndarray, velocity: np.ndarray, earliest: float, accuracy: float,
             iterations: int) -> float:
    """Return the arc length at which the gap of point i closes (signed distance -theta), by Newton's method.

    x, velocity: its position relative to the tool and d/ds, shape (2,), length. accuracy: error of the distance over
    theta. The result is at least `earliest`; it is the last iterate if the point does not approach its tool.
    """
    if (profile := law.profile) is not None:
        shift = law.shift[i] if isinstance(law.shift, np.ndarray) else law.shift
        return float(_C.crossing(x, velocity, law.theta, shift, earliest, accuracy * law.theta, iterations,
                                 len(profile.table), profile.lines, profile.table))
    law, s = law.part([i]), 0.0
    for _ in range(iterations):
        near = law.nearest((x + s * velocity)[None])
        gap, rate = float(near.distance[0]) + law.theta, float(near.normal[0] @ velocity)
        if abs(gap) < accuracy * law.theta or not rate > 0:
            break
        s = max(s - gap / rate, earliest)
    return s
