"""Functions of the condensed contact problem in C: forces at given statuses, search of statuses, next change of status.

`reduced_contact` states the equations. Runs call the functions thousands of times, for few points each time.
"""

from __future__ import annotations

from typing import Any

from ..._jit import functions

_BODY = """long, const double *, const double *, const double *, const double *, const double *, const double *,
    const double *, const double *, const double *, const double *"""

_HEADER = f"""
int forces_at_end({_BODY}, const double *, const long *, const double *, const double *, double *, double *);
int admissible_rates({_BODY}, const double *, long *, const double *, double *, double *);
double next_change({_BODY}, const long *, const double *, const double *, long *);
"""

_SOURCE = r"""
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {SLIDES_BACK = -1, STICKS, SLIDES, FREE};
enum {ALL_AT_ONCE, TRIES, NONE, SOON, LIMIT};

/* m points: settings; compliance (2m, 2m), stiffness (m, 2, 2), friction, elastic slips, mask of points that pull;
   frame of the tool: normals, tangents, curvatures, missing penetrations */
typedef struct {
    long m;
    const double *set, *C, *S, *friction, *elastic_slip, *pulls, *normal, *tangent, *curvature, *beyond;
} Points;

#define POINTS long m, const double *set, const double *C, const double *S, const double *friction, \
    const double *elastic_slip, const double *pulls, const double *normal, const double *tangent, \
    const double *curvature, const double *beyond
#define GIVEN {m, set, C, S, friction, elastic_slip, pulls, normal, tangent, curvature, beyond}

static double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1]; }
static double sign(double a) { return (a > 0) - (a < 0); }
static double largest(long n, const double *a)
{
    double found = 0;
    for (long i = 0; i < n; i++) if (!(fabs(a[i]) <= found)) found = fabs(a[i]);
    return found;
}
static double coefficient(const Points *p, long i) { return isinf(p->friction[i]) ? 0.0 : p->friction[i]; }

/* solve A X = B, (n, n) and (n, r), in place, with row pivots; 1 if A is singular */
static int eliminate(long n, double *A, long r, double *B)
{
    for (long k = 0; k < n; k++) {
        long best = k;
        for (long i = k + 1; i < n; i++) if (fabs(A[i * n + k]) > fabs(A[best * n + k])) best = i;
        if (A[best * n + k] == 0) return 1;
        if (best != k) {
            for (long j = k; j < n; j++) {
                double a = A[k * n + j]; A[k * n + j] = A[best * n + j]; A[best * n + j] = a;
            }
            for (long j = 0; j < r; j++) {
                double b = B[k * r + j]; B[k * r + j] = B[best * r + j]; B[best * r + j] = b;
            }
        }
        for (long i = k + 1; i < n; i++) {
            double f = A[i * n + k] / A[k * n + k];
            if (f == 0) continue;
            for (long j = k + 1; j < n; j++) A[i * n + j] -= f * A[k * n + j];
            for (long j = 0; j < r; j++) B[i * r + j] -= f * B[k * r + j];
        }
    }
    for (long k = n - 1; k >= 0; k--) {
        for (long i = k + 1; i < n; i++)
            for (long j = 0; j < r; j++) B[k * r + j] -= A[k * n + i] * B[i * r + j];
        for (long j = 0; j < r; j++) B[k * r + j] /= A[k * n + k];
    }
    return 0;
}

/* motion without contact stiffness, for motions u and present forces: X = (I - C K)^-1 (u, C), shape (2m, 1 + 2m), with
   K = S - turn at each point; turn (m, 2, 2): forces that rotate with a curved tool. 1 if singular */
static int without_stiffness(const Points *p, const double *u, const double *force, double *X, double *turn)
{
    long m = p->m, n = 2 * m, w = n + 1, q = 0, *stiff = malloc(m * sizeof(long) + 1), bad = 0;
    double *K = malloc(4 * m * sizeof(double) + 1);
    for (long i = 0; i < m; i++) {
        const double *nn = p->normal + 2 * i, *t = p->tangent + 2 * i;
        double N = dot(force + 2 * i, nn), T = dot(force + 2 * i, t), *k = K + 4 * q;
        for (int a = 0; a < 2; a++)
            for (int b = 0; b < 2; b++) {
                turn[4 * i + 2 * a + b] = p->curvature[i] * ((N * t[a] - T * nn[a]) * t[b]);
                k[2 * a + b] = p->S[4 * i + 2 * a + b] - turn[4 * i + 2 * a + b];
            }
        if (k[0] != 0 || k[1] != 0 || k[2] != 0 || k[3] != 0) stiff[q++] = i;
    }
    for (long a = 0; a < n; a++) {
        X[a * w] = u[a];
        memcpy(X + a * w + 1, p->C + a * n, n * sizeof(double));
    }
    if (q) {
        long h = 2 * q;
        double *J = malloc(h * h * sizeof(double)), *Y = malloc(h * w * sizeof(double));
        for (long a = 0; a < h; a++) {
            long row = 2 * stiff[a / 2] + a % 2;
            memcpy(Y + a * w, X + row * w, w * sizeof(double));
            for (long b = 0; b < h; b++) {
                const double *c = p->C + row * n + 2 * stiff[b / 2], *k = K + 4 * (b / 2);
                J[a * h + b] = (a == b) - (c[0] * k[b % 2] + c[1] * k[2 + b % 2]);
            }
        }
        bad = eliminate(h, J, w, Y);
        for (long j = 0; j < q; j++)
            for (long b = 0; b < w; b++) {
                double y = Y[2 * j * w + b], z = Y[(2 * j + 1) * w + b];
                Y[2 * j * w + b] = K[4 * j] * y + K[4 * j + 1] * z;
                Y[(2 * j + 1) * w + b] = K[4 * j + 2] * y + K[4 * j + 3] * z;
            }
        for (long a = 0; a < n; a++)
            for (long j = 0; j < h; j++) {
                double c = p->C[a * n + 2 * stiff[j / 2] + j % 2], *x = X + a * w, *y = Y + j * w;
                for (long b = 0; b < w; b++) x[b] += c * y[b];
            }
        free(J); free(Y);
    }
    free(stiff); free(K);
    return bad;
}

/* forces F, or their rates without `to`, and motions dx of the points at given statuses; `to`: motions of sticking
   points; slips: compliance of their elastic slip. 1 if singular */
static int solved(const Points *p, const double *X, const double *turn, const long *status, const double *to,
                  const double *slips, double *F, double *dx)
{
    long m = p->m, w = 2 * m + 1, sticks = 0, n = 0, *point = malloc(2 * m * sizeof(long) + 1);
    for (int kind = 0; kind < 3; kind++) {               /* normals, tangents of sticking points, sliding points */
        for (long i = 0; i < m; i++) {
            int stuck = status[i] == STICKS && p->friction[i] > 0;
            if (status[i] != FREE && stuck == (kind < 2)) point[n++] = i;
        }
        if (!kind) sticks = n;
    }
    double *A = malloc(n * n * sizeof(double) + 1), *b = malloc(n * sizeof(double) + 1), most = 0;
    double *into = malloc(4 * n * sizeof(double) + 1), *against = into + 2 * n;
    for (long r = 0; r < n; r++) {
        long i = point[r];
        int slides = r >= 2 * sticks;
        const double *along = p->tangent + 2 * i, *way = slides || r < sticks ? p->normal + 2 * i : along;
        for (int a = 0; a < 2; a++) {
            into[2 * r + a] = way[a];
            against[2 * r + a] = slides ? way[a] + coefficient(p, i) * status[i] * along[a] : way[a];
        }
    }
    for (long r = 0; r < n; r++) {
        const double *x = X + 2 * point[r] * w, *d = into + 2 * r;
        for (long s = 0; s < n; s++) {
            long k = 1 + 2 * point[s];
            const double *g = against + 2 * s;
            A[r * n + s] = (d[0] * x[k] + d[1] * x[w + k]) * g[0] + (d[0] * x[k + 1] + d[1] * x[w + k + 1]) * g[1];
        }
        b[r] = d[0] * x[0] + d[1] * x[w];
        if (to) b[r] -= r < 2 * sticks ? dot(to + 2 * point[r], d) : p->beyond[point[r]];
    }
    most = largest(n * n, A);
    for (long r = 0; r < n; r++)                         /* no motion along a support or across the axis */
        if (largest(n, A + r * n) < p->set[NONE] * most) A[r * n + r] = most;
    for (long r = sticks; slips && r < 2 * sticks; r++) A[r * n + r] += slips[point[r]];
    int bad = eliminate(n, A, 1, b);
    memset(F, 0, 2 * m * sizeof(double));
    for (long r = 0; r < n; r++)
        for (int a = 0; a < 2; a++) F[2 * point[r] + a] += against[2 * r + a] * b[r];
    for (long a = 0; a < 2 * m; a++) {
        double moved = 0;
        for (long j = 0; j < 2 * m; j++) moved += X[a * w + 1 + j] * F[j];
        dx[a] = X[a * w] - moved;
    }
    for (long i = 0; i < m; i++)
        for (int a = 0; a < 2; a++) F[2 * i + a] += dot(turn + 4 * i + 2 * a, dx + 2 * i);
    free(point); free(A); free(b); free(into);
    return bad;
}

/* less[m, 2]: changes of the forces outside the factorised tangent, F - before - S dx */
static void outside(const Points *p, const double *F, const double *before, const double *dx, double *less)
{
    for (long a = 0; a < 2 * p->m; a++)
        less[a] = F[a] - (before ? before[a] : 0.0) - dot(p->S + 2 * a, dx + a / 2 * 2);
}

/* see `Points.held`; `extra` and F receive the results. 1 if singular */
int forces_at_end(POINTS, const double *u, const long *status, const double *force, const double *to, double *F,
                  double *extra)
{
    Points p = GIVEN;
    long n = 2 * m;
    double *X = malloc(n * (n + 1) * sizeof(double) + 1), *work = malloc(11 * m * sizeof(double) + 1);
    double *start = work, *closed = start + n, *turn = closed + n, *slips = turn + 4 * m, *dx = slips + m;
    for (long a = 0; a < n; a++) {
        double moved = 0;
        for (long j = 0; j < n; j++) moved += C[a * n + j] * force[j];
        start[a] = u[a] + moved;
        closed[a] = status[a / 2] != FREE ? force[a] : 0.0;
    }
    for (long i = 0; i < m; i++) {
        double limit = coefficient(&p, i) * dot(force + 2 * i, normal + 2 * i);
        slips[i] = limit > 0 ? elastic_slip[i] / limit : 0.0;
    }
    int bad = without_stiffness(&p, start, closed, X, turn) || solved(&p, X, turn, status, to, slips, F, dx);
    outside(&p, F, force, dx, extra);
    free(X); free(work);
    return bad;
}

/* search for statuses (an active set) whose rates satisfy Coulomb's law; 1 if none are found */
static int agreed(const Points *p, const double *X, const double *turn, const double *force, const char *here,
                  long *status, double *F, double *dx)
{
    long m = p->m, tries = p->set[TRIES], *seen = malloc(tries * m * sizeof(long)), *other = malloc(m * sizeof(long));
    double *values = malloc(8 * m * sizeof(double)), *N = values, *T = N + m, *dN = T + m, *dT = dN + m, *in = dT + m;
    double *along = in + m, *miss = along + m, limit = p->set[LIMIT], none = p->set[NONE];
    int found = 1;
    for (long i = 0; i < m; i++) {
        N[i] = dot(force + 2 * i, p->normal + 2 * i);
        T[i] = dot(force + 2 * i, p->tangent + 2 * i);
    }
    for (long k = 0; k < tries; k++) {
        int finite = !solved(p, X, turn, status, NULL, NULL, F, dx);
        for (long a = 0; a < 2 * m; a++) finite &= isfinite(F[a]) != 0;
        if (!finite) break;
        for (long i = 0; i < m; i++) {
            dN[i] = dot(F + 2 * i, p->normal + 2 * i);
            dT[i] = dot(F + 2 * i, p->tangent + 2 * i);
            in[i] = dot(dx + 2 * i, p->normal + 2 * i);
            along[i] = dot(dx + 2 * i, p->tangent + 2 * i);
        }
        double negligible = limit * (largest(m, N) + p->set[SOON] * largest(m, dN)), worst = -INFINITY;
        double moves = none * largest(m, along), grows = none * largest(m, dT);
        long changes = 0, first = 0;
        for (long i = 0; i < m; i++) {
            double mu = coefficient(p, i), soft = (p->C[4 * m * i + 2 * i] + p->C[4 * m * i + 2 * m + 2 * i + 1]) / 2;
            int closed = status[i] != FREE;
            other[i] = status[i];
            if (closed && status[i] != STICKS && mu > 0 && status[i] * along[i] < -moves) {
                other[i] = STICKS;
                miss[i] = fabs(along[i]);
            }
            double sense = sign(fabs(T[i]) > mu * negligible ? T[i] : dT[i]);
            double most = mu * ((1 - limit) * N[i] - negligible);
            if (status[i] == STICKS && !isinf(p->friction[i]) && fabs(T[i]) >= most) {
                double over = sense * dT[i] - mu * dN[i];
                if (over > grows) {
                    other[i] = sense;
                    miss[i] = over * soft;
                }
            }
            if (closed && !p->pulls[i] && negligible >= N[i] && dN[i] < 0) {
                other[i] = FREE;
                miss[i] = -(dN[i] * soft);
            }
            if (here[i] && !closed && in[i] > 0) {
                other[i] = isinf(p->friction[i]) ? STICKS : along[i] < 0 ? SLIDES_BACK : SLIDES;
                miss[i] = in[i];
            }
            if (other[i] == status[i]) continue;
            changes++;
            if (miss[i] > worst) {
                worst = miss[i];
                first = i;
            }
        }
        if (!changes) {
            found = 0;
            break;
        }
        int one = k >= p->set[ALL_AT_ONCE];
        for (long j = 0; j < k; j++) one |= !memcmp(seen + j * m, status, m * sizeof(long));
        memcpy(seen + k * m, status, m * sizeof(long));
        for (long i = 0; i < m; i++) if (!one || i == first) status[i] = other[i];
    }
    free(seen); free(other); free(values);
    return found;
}

/* see `Points.rates`; F, extra and status receive the results. 1 if no admissible statuses are found */
int admissible_rates(POINTS, const double *u, long *status, const double *force, double *F, double *extra)
{
    Points p = GIVEN;
    long n = 2 * m, *start = malloc(m * sizeof(long) + 1);
    double *X = malloc(n * (n + 1) * sizeof(double) + 1), *turn = malloc(4 * m * sizeof(double) + 1);
    double *dx = malloc(n * sizeof(double) + 1), most = 0;
    char *here = malloc(m + 1);
    int bad = without_stiffness(&p, u, force, X, turn);
    memcpy(start, status, m * sizeof(long));
    for (long i = 0; i < m; i++) {
        here[i] = status[i] != FREE;
        most = fmax(most, fabs(dot(force + 2 * i, normal + 2 * i)));
    }
    if (!bad) bad = agreed(&p, X, turn, force, here, status, F, dx) ? 2 : 0;
    if (bad == 2) {                                      /* again, with points of no pressure open */
        for (long i = 0; i < m; i++)
            if (here[i] && !pulls[i] && most * set[LIMIT] >= dot(force + 2 * i, normal + 2 * i)) status[i] = FREE;
            else status[i] = start[i];
        bad = agreed(&p, X, turn, force, here, status, F, dx);
    }
    outside(&p, F, NULL, dx, extra);
    free(start); free(X); free(turn); free(dx); free(here);
    return bad;
}

/* see `Points.change`: arc length to the first change of a status; `after` receives the statuses after it */
double next_change(POINTS, const long *status, const double *force, const double *rate, long *after)
{
    Points p = GIVEN;
    double first = INFINITY, most = 1e-30;
    long which = -1, to = 0;
    for (long i = 0; i < m; i++) most = fmax(most, fabs(dot(force + 2 * i, normal + 2 * i)));
    memcpy(after, status, m * sizeof(long));
    for (long i = 0; i < m; i++) {
        double N = dot(force + 2 * i, normal + 2 * i), T = dot(force + 2 * i, tangent + 2 * i), time = INFINITY;
        double dN = dot(rate + 2 * i, normal + 2 * i), dT = dot(rate + 2 * i, tangent + 2 * i), mu = coefficient(&p, i);
        long next = status[i];
        if (status[i] != FREE && !pulls[i] && dN < 0 && set[LIMIT] * most < N) {
            time = -N / dN;
            next = FREE;
        }
        for (int sense = 1; status[i] == STICKS && !isinf(friction[i]) && sense >= -1; sense -= 2) {
            double margin = mu * N - sense * T, closing = sense * dT - mu * dN;
            if (closing > 0 && margin > set[LIMIT] * mu * fabs(N) && margin / closing < time) {
                time = margin / closing;
                next = sense;
            }
        }
        if (time < first) {
            first = time;
            which = i;
            to = next;
        }
    }
    if (which >= 0) after[which] = to;
    return first;
}
"""


def compiled() -> Any:
    """Return the functions `forces_at_end`, `admissible_rates` and `next_change` in C."""
    return functions("contact_events", _HEADER, _SOURCE)
