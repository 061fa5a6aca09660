/* Search for crossing edges. A run tests the boundary of the body for self-intersection in each state. */
#include <math.h>

static double turn(const double *a, const double *b, const double *c)
{
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

/* whether a point lies on the edge from p to q */
static int on(const double *x, const double *p, const double *q)
{
    double u = q[0] - p[0], v = q[1] - p[1], length = u * u + v * v;
    double t = ((x[0] - p[0]) * u + (x[1] - p[1]) * v) / length;
    if (isnan(t)) return 0;
    t = fmin(fmax(t, 0.0), 1.0);
    u = x[0] - p[0] - t * u;
    v = x[1] - p[1] - t * v;
    return u * u + v * v <= 1e-18 * length;
}

/* found[k]: whether the edges first[k] and second[k] cross, or touch anywhere but in a common node */
void cross(long pairs, const long *first, const long *second, const double *points, const long *edges, double *found)
{
    for (long k = 0; k < pairs; k++) {
        const long *e = edges + 2 * first[k], *f = edges + 2 * second[k];
        const double *a = points + 2 * e[0], *b = points + 2 * e[1], *c = points + 2 * f[0], *d = points + 2 * f[1];
        int apart[4] = {e[0] != f[0] && e[0] != f[1], e[1] != f[0] && e[1] != f[1],
                        f[0] != e[0] && f[0] != e[1], f[1] != e[0] && f[1] != e[1]};
        found[k] = (apart[0] && apart[1] && turn(a, b, c) * turn(a, b, d) < 0 && turn(c, d, a) * turn(c, d, b) < 0)
                || (apart[0] && on(a, c, d)) || (apart[1] && on(b, c, d))
                || (apart[2] && on(c, a, b)) || (apart[3] && on(d, a, b));
    }
}
