"""Arc lengths at which open points on straight paths reach their tools, computed in C for tools of lines and arcs.

The prediction of contact events asks hundreds of times in a run, for few points each time.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .._jit import address, functions
from ..tools.nearest import SOURCE

_HEADER = """
void gap_closures(long, const double *, const double *, const double *, long, double, double, const double *, long,
                  long, long, const double *, double *);
double crossing(const double *, const double *, double, double, double, double, long, long, long, const double *);
"""

_SOURCE = SOURCE + r"""
/* times (n) at which the points x + time w, (n, 2) each, reach the distance -theta + shift from the profile; in the
   first of the intervals between multiples of `part` in which they do. Others keep the value that `times` has on entry.
   shift: one value, or with stride 1 (n) */
void gap_closures(long points, const double *x, const double *w, const double *open, long intervals, double part,
                  double theta, const double *shift, long stride, long pieces, long lines, const double *table,
                  double *times)
{
    for (long i = 0; i < points; i++, x += 2, w += 2, shift += stride) {
        double distance, before, now, travel = 1.01 * (part * intervals) * sqrt(w[0] * w[0] + w[1] * w[1]);
        if (!open[i]) continue;
        closest(x, pieces, lines, table, &distance);
        now = -theta - (distance - *shift);
        if (!(travel > now)) continue;                                     /* the path is too short */
        for (long k = 0; k < intervals; k++) {
            double from = part * k, to = part * (k + 1), y[2] = {x[0] + to * w[0], x[1] + to * w[1]};
            before = fmax(now, 0.0);
            closest(y, pieces, lines, table, &distance);
            now = -theta - (distance - *shift);
            if (now <= 0) {
                times[i] = from + (to - from) * (before > 0 ? before / (before - now) : 0.0);
                break;
            }
        }
    }
}

/* time, at least `earliest`, at which the point x + time w is at the distance -theta + shift from the profile, by
   Newton's method from time 0 to the `accuracy` */
double crossing(const double *x, const double *w, double theta, double shift, double earliest, double accuracy,
                long iterations, long pieces, long lines, const double *table)
{
    double time = 0.0, distance, normal[2], curvature;
    for (long k = 0; k < iterations; k++) {
        double y[2] = {x[0] + time * w[0], x[1] + time * w[1]};
        nearest(1, y, pieces, lines, table, &distance, normal, &curvature);
        double gap = distance - shift + theta, rate = normal[0] * w[0] + normal[1] * w[1];
        if (fabs(gap) < accuracy || !(rate > 0)) break;
        time = fmax(time - gap / rate, earliest);
    }
    return time;
}
"""


def gap_closures(law: Any, start: np.ndarray, velocity: np.ndarray, free: np.ndarray, length: float) -> np.ndarray:
    """Return the arc length at which the gap of each point closes, shape (n,); `length` if it stays open.

    It is `length`, too, for points outside the mask `free`, shape (n,), which are closed. start, velocity: positions
    relative to the tool and d/ds, shape (n, c), length. Contact begins at the signed distance -theta, positive inside;
    theta is the half-width of the contact ramp.
    """
    arc_lengths, profile = np.full(len(start), float(length)), law.profile
    if profile is not None:
        _compiled().gap_closures(len(start), address(start), address(velocity), address(free), 16, length / 16,
                                 law.theta, address(law.shift), np.ndim(law.shift), *profile.compiled_table,
                                 address(arc_lengths))
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
    if law.profile is not None:
        shift = law.shift[i] if isinstance(law.shift, np.ndarray) else law.shift
        return float(_compiled().crossing(address(x), address(velocity), law.theta, shift, earliest,
                                          accuracy * law.theta, iterations, *law.profile.compiled_table))
    law, s = law.part([i]), 0.0
    for _ in range(iterations):
        near = law.nearest((x + s * velocity)[None])
        gap, rate = float(near.distance[0]) + law.theta, float(near.normal[0] @ velocity)
        if abs(gap) < accuracy * law.theta or not rate > 0:
            break
        s = max(s - gap / rate, earliest)
    return s


def _compiled() -> Any:
    """Return the functions `gap_closures` and `crossing` in C."""
    return functions("gap_closures", _HEADER, _SOURCE)
