"""Closest points of a profile of lines and arcs, computed in C.

Contact queries its tools thousands of times in a run, for few points each time. Array operations would cost more than
the arithmetic. The function is compiled once, into the cache folder of compiled forms.
"""

from __future__ import annotations

import numpy as np

from .._jit import address, functions

_HEADER = "void nearest(long, const double *, long, long, const double *, double *, double *, double *);"

SOURCE = r"""
#include <math.h>

enum {R, Z, ALONG_R, ALONG_Z, SIGN, LOW, HIGH, RADIUS, START, COLUMNS};
static const double turn = 6.283185307179586;

/* the piece closest to (r, z): the first of equal ones, or -1; beyond: every piece counts as if it were longer */
static long closest_of(double r, double z, long pieces, long lines, const double *table, int beyond, double *distance)
{
    long best = -1;
    for (long k = 0; k < pieces; k++) {
        const double *p = table + k * COLUMNS, u = r - p[R], v = z - p[Z];
        double d, at;
        if (k < lines) {
            at = u * p[ALONG_R] + v * p[ALONG_Z];
            d = u * -p[ALONG_Z] + v * p[ALONG_R];
        } else {
            d = p[SIGN] * (p[RADIUS] - hypot(u, v));
            if (best >= 0 && fabs(d) >= fabs(*distance)) continue;
            at = 0.0;
            if (!beyond && p[HIGH] < turn) {
                at = fmod(p[SIGN] * (atan2(v, u) - p[START]), turn);
                if (at < 0) at += turn;
            }
        }
        if (!beyond && (at < p[LOW] || at > p[HIGH])) continue;
        if (best < 0 || fabs(d) < fabs(*distance)) { *distance = d; best = k; }
    }
    return best;
}

/* the piece closest to x (2), and the signed distance of x from it */
static long closest(const double *x, long pieces, long lines, const double *table, double *distance)
{
    long k = closest_of(x[0], x[1], pieces, lines, table, 0, distance);
    return k < 0 ? closest_of(x[0], x[1], pieces, lines, table, 1, distance) : k;
}

void nearest(long points, const double *x, long pieces, long lines, const double *table, double *distance,
             double *normal, double *curvature)
{
    for (long i = 0; i < points; i++, x += 2, normal += 2) {
        long k = closest(x, pieces, lines, table, distance + i);
        const double *p = table + k * COLUMNS, u = x[0] - p[R], v = x[1] - p[Z], away = hypot(u, v);
        curvature[i] = -p[SIGN] / (away < 1e-300 ? 1e-300 : away);
        normal[0] = -p[ALONG_Z] + curvature[i] * u;
        normal[1] = p[ALONG_R] + curvature[i] * v;
    }
}
"""
"""Definitions in C, of which other functions in C make use (`formingx.contact.gap_closures`)."""


def nearest(x: np.ndarray, table: np.ndarray, lines: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return distances from a profile, (n,), gradients, (n, 2), curvatures of level lines, (n,), at x, (n, 2).

    Distances are positive inside. The table has m pieces, `lines` first, shape (m, 9). A line has origin, direction, 0,
    lowest and highest length, 0, 0. An arc has centre, 0, 0, sense (1: left), 0, angle, radius, first polar angle.
    """
    n = len(x)
    found = np.empty(4 * n)
    out = address(found)
    functions("nearest", _HEADER, SOURCE).nearest(n, address(x), len(table), lines, address(table), out, out + n,
                                                   out + 3 * n)
    return found[:n], found[n:3 * n].reshape(n, 2), found[3 * n:]
