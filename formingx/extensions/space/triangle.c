/* Nearest point of a flat triangle. */
#include <math.h>

static double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static inline void cross(const double *a, const double *b, double *c)
{
    c[0] = a[1] * b[2] - a[2] * b[1]; c[1] = a[2] * b[0] - a[0] * b[2]; c[2] = a[0] * b[1] - a[1] * b[0];
}

static double away(const double *p, const double *x, double *r)
{
    for (int i = 0; i < 3; i++) r[i] = p[i] - x[i];
    return dot(r, r);
}

/* barycentric coordinates u, v of the nearest point of the flat triangle a, b, c (Ericson, chapter 5.1.5) */
static void flat(const double *a, const double *b, const double *c, const double *x, double *u, double *v)
{
    double p[3], q[3], r[3];
    for (int i = 0; i < 3; i++) { p[i] = b[i] - a[i]; q[i] = c[i] - a[i]; r[i] = x[i] - a[i]; }
    double d1 = dot(p, r), d2 = dot(q, r);
    if (d1 <= 0 && d2 <= 0) { *u = 1; *v = 0; return; }
    for (int i = 0; i < 3; i++) r[i] = x[i] - b[i];
    double d3 = dot(p, r), d4 = dot(q, r);
    if (d3 >= 0 && d4 <= d3) { *u = 0; *v = 1; return; }
    double vc = d1 * d4 - d3 * d2;
    if (vc <= 0 && d1 >= 0 && d3 <= 0) { double t = d1 / (d1 - d3); *u = 1 - t; *v = t; return; }
    for (int i = 0; i < 3; i++) r[i] = x[i] - c[i];
    double d5 = dot(p, r), d6 = dot(q, r);
    if (d6 >= 0 && d5 <= d6) { *u = 0; *v = 0; return; }
    double vb = d5 * d2 - d1 * d6;
    if (vb <= 0 && d2 >= 0 && d6 <= 0) { double t = d2 / (d2 - d6); *u = 1 - t; *v = 0; return; }
    double va = d3 * d6 - d5 * d4;
    if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
        double t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        *u = 0; *v = 1 - t; return;
    }
    double all = 1 / (va + vb + vc);
    *v = vb * all; *u = 1 - *v - vc * all;
}
