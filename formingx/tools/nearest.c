/* Closest points of a profile of lines and arcs. Contact queries its tools thousands of times in a run, for few points
   each time. A table has the pieces in rows, lines first, as `Tool.table` in profile.py. */
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
