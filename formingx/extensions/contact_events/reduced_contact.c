/* Frictional contact of a few points, condensed onto their contact forces: reduced_contact.py has the equations. The
   prediction of contact events solves them hundreds of times in a run, for few points each time. */
#include "../../tools/nearest.c"
#include <stdlib.h>
#include <string.h>

enum {BACK = -1, STICKS, SLIDES, FREE};                             /* `ContactStatus` */
enum {ALL_AT_ONCE, TRIES, NONE, LIMIT, COMPARISON_LENGTH};          /* of the array `search`: `StatusSearch`, a length */

/* m contact points: coefficient of friction, whether they adhere, stiffness S in the factorised tangent (m, 2, 2),
   compliance C (2 m, 2 m), unit normal (m, 2) and curvature of the tool */
typedef struct { long m; const double *friction, *pulls, *S, *C, *normal, *curvature; } Points;

/* motion dx = free - by F of the points under contact forces F, as columns [free, by], (2 m, 1 + 2 m); forces turn dx
   rotate with a curved tool, turn (m, 2, 2); room for a matrix (2 m, 2 m) and seven vectors (2 m) */
typedef struct { double *columns, *turn, *room; } System;

static System new_system(long m)
{
    long n = 2 * m;
    System s = {malloc((n * (n + 1) + 2 * n + n * n + 7 * n + 1) * sizeof(double))};
    s.turn = s.columns + n * (n + 1);
    s.room = s.turn + 2 * n;
    return s;
}

static double sign(double a) { return (a > 0) - (a < 0); }

static double mu(const Points *p, long i) { return isinf(p->friction[i]) ? 0.0 : p->friction[i]; }

/* components N and T of the vector f at point i, normal and tangential to the tool; f (m, 2) */
static double N_of(const Points *p, const double *f, long i)
{
    return p->normal[2 * i] * f[2 * i] + p->normal[2 * i + 1] * f[2 * i + 1];
}

static double T_of(const Points *p, const double *f, long i)
{
    return p->normal[2 * i] * f[2 * i + 1] - p->normal[2 * i + 1] * f[2 * i];
}

/* largest |N| or |T| of the points */
static double largest(const Points *p, double (*part)(const Points *, const double *, long), const double *f)
{
    double most = 0.0;
    for (long i = 0; i < p->m; i++) most = fmax(most, fabs(part(p, f, i)));
    return most;
}

/* y += factor A x at each point; A (m, 2, 2), x and y (m, 2) */
static void add_product(long m, double factor, const double *A, const double *x, double *y)
{
    for (long i = 0; i < 2 * m; i++)
        y[i] += factor * (A[2 * i] * x[i / 2 * 2] + A[2 * i + 1] * x[i / 2 * 2 + 1]);
}

static void exchange(long n, double *a, double *b)
{
    for (long i = 0; i < n; i++) { double kept = a[i]; a[i] = b[i]; b[i] = kept; }
}

/* solve A X = B in place by Gaussian elimination with row pivots; A (n, n), B (n, k); 0 if A is singular */
static int solve(long n, double *A, long k, double *B)
{
    for (long c = 0; c < n; c++) {
        long pivot = c;
        for (long r = c + 1; r < n; r++) if (fabs(A[r * n + c]) > fabs(A[pivot * n + c])) pivot = r;
        if (!(fabs(A[pivot * n + c]) > 0)) return 0;
        if (pivot != c) {
            exchange(n, A + c * n, A + pivot * n);
            exchange(k, B + c * k, B + pivot * k);
        }
        for (long r = c + 1; r < n; r++) {
            double share = A[r * n + c] / A[c * n + c];
            if (share == 0) continue;
            for (long j = c + 1; j < n; j++) A[r * n + j] -= share * A[c * n + j];
            for (long j = 0; j < k; j++) B[r * k + j] -= share * B[c * k + j];
        }
    }
    for (long r = n - 1; r >= 0; r--) {
        for (long c = r + 1; c < n; c++)
            for (long j = 0; j < k; j++) B[r * k + j] -= A[r * n + c] * B[c * k + j];
        for (long j = 0; j < k; j++) B[r * k + j] /= A[r * n + r];
    }
    return 1;
}

/* system of the points without the stiffness S: (1 - C (S - turn)) dx = u - C F with turn = curvature (N t - T n) t^T,
   for present forces and motions u, (m, 2) each; 0 if it is singular */
static int condense(const Points *p, const double *u, const double *force, System *s)
{
    long n = 2 * p->m;
    double *A = s->room, *stiffness = A + n * n;                    /* S - turn (m, 2, 2) */
    int stiff = 0;
    for (long i = 0; i < p->m; i++) {
        const double *normal = p->normal + 2 * i, t[2] = {-normal[1], normal[0]};
        double N = N_of(p, force, i), T = T_of(p, force, i);
        for (int a = 0; a < 4; a++) {
            s->turn[4 * i + a] = p->curvature[i] * ((N * t[a / 2] - T * normal[a / 2]) * t[a % 2]);
            stiffness[4 * i + a] = p->S[4 * i + a] - s->turn[4 * i + a];
            stiff |= stiffness[4 * i + a] != 0;
        }
    }
    for (long r = 0; r < n; r++) {
        s->columns[r * (n + 1)] = u[r];
        memcpy(s->columns + r * (n + 1) + 1, p->C + r * n, n * sizeof(double));
        for (long c = 0; c < n; c++) {
            const double *C = p->C + r * n + c / 2 * 2, *K = stiffness + c / 2 * 4 + c % 2;
            A[r * n + c] = (r == c) - (C[0] * K[0] + C[1] * K[2]);
        }
    }
    return !stiff || solve(n, A, n + 1, s->columns);
}

/* contact forces F (m, 2) and motions dx (m, 2) at given statuses; 0 without a unique solution. Unknown are a normal
   and a tangential force of each sticking point, and n + mu t of each sliding one. Sticking points move by `to` (m, 2)
   and slip by slips T (m), sliding ones move by `beyond` (m) along n; all three are NULL for rates, without motion */
static int solved(const Points *p, const System *s, const long *status, const double *to, const double *slips,
                  const double *beyond, double none, double *F, double *dx)
{
    long n = 2 * p->m, unknowns = 0, sticking = 0;
    double *A = s->room, *amounts = A + n * n, *into = amounts + n, *against = into + 2 * n, most = 0.0;
    long *point = malloc((n + 1) * sizeof(long));
    for (int kind = 0; kind < 3; kind++)                            /* normal, tangential, sliding */
        for (long i = 0; i < p->m; i++) {
            int stuck = status[i] == STICKS && p->friction[i] > 0;
            if (status[i] == FREE || stuck != (kind < 2)) continue;
            const double *normal = p->normal + 2 * i, t[2] = {-normal[1], normal[0]};
            double *d = into + 2 * unknowns, rubs = kind < 2 ? 0.0 : mu(p, i) * status[i];
            for (int a = 0; a < 2; a++) {
                d[a] = kind == 1 ? t[a] : normal[a];
                against[2 * unknowns + a] = d[a] + rubs * t[a];
            }
            amounts[unknowns] = !to ? 0.0 : kind < 2 ? -(to[2 * i] * d[0] + to[2 * i + 1] * d[1]) : -beyond[i];
            sticking += kind == 0;
            point[unknowns++] = i;
        }
    double *most_of = against + 2 * n;
    for (long r = 0; r < unknowns; r++) {
        const double *row = s->columns + 2 * point[r] * (n + 1), *d = into + 2 * r;
        amounts[r] += d[0] * row[0] + d[1] * row[n + 1];
        most_of[r] = 0.0;
        for (long c = 0; c < unknowns; c++) {
            const double *C = row + 1 + 2 * point[c], *e = against + 2 * c;
            double a = (d[0] * C[0] + d[1] * C[n + 1]) * e[0] + (d[0] * C[1] + d[1] * C[n + 2]) * e[1];
            A[r * unknowns + c] = a;
            most_of[r] = fmax(most_of[r], fabs(a));
        }
        most = fmax(most, most_of[r]);
    }
    for (long r = 0; r < unknowns; r++) {
        if (most_of[r] < none * most) A[r * unknowns + r] = most;   /* no motion along a support or across the axis */
        if (slips && sticking <= r && r < 2 * sticking) A[r * unknowns + r] += slips[point[r]];
    }
    int good = solve(unknowns, A, 1, amounts);
    memset(F, 0, n * sizeof(double));
    for (long r = 0; r < unknowns; r++)
        for (int a = 0; a < 2; a++) F[2 * point[r] + a] += amounts[r] * against[2 * r + a];
    for (long r = 0; r < n; r++) {
        const double *row = s->columns + r * (n + 1);
        dx[r] = row[0];
        for (long c = 0; c < n; c++) dx[r] -= row[1 + c] * F[c];
    }
    add_product(p->m, 1.0, s->turn, dx, F);
    free(point);
    return good;
}

/* contact forces F (m, 2) after a motion u (m, 2), and their part outside the tangent, F - force - S dx; other
   arguments as in `Points.forces_at_end`; 0 without a unique solution */
int forces_at_end(long m, const double *friction, const double *pulls, const double *S, const double *C,
                  const double *normal, const double *curvature, const double *elastic_slip, const double *beyond,
                  const double *u, const long *status, const double *force, const double *to, const double *search,
                  double *F, double *outside)
{
    Points p = {m, friction, pulls, S, C, normal, curvature};
    System s = new_system(m);
    double *free_motion = malloc((7 * m + 1) * sizeof(double)), *closed = free_motion + 2 * m;
    double *dx = closed + 2 * m, *slips = dx + 2 * m;
    for (long r = 0; r < 2 * m; r++) {
        double back = 0.0;
        for (long c = 0; c < 2 * m; c++) back += C[r * 2 * m + c] * force[c];
        free_motion[r] = u[r] + back;
        closed[r] = status[r / 2] == FREE ? 0.0 : force[r];
    }
    for (long i = 0; i < m; i++) {
        double most = mu(&p, i) * N_of(&p, force, i);
        slips[i] = most > 0 ? elastic_slip[i] / most : 0.0;
    }
    int good = condense(&p, free_motion, closed, &s)
            && solved(&p, &s, status, to, slips, beyond, search[NONE], F, dx);
    for (long r = 0; good && r < 2 * m; r++) outside[r] = F[r] - force[r];
    if (good) add_product(m, -1.0, S, dx, outside);
    free(free_motion);
    free(s.columns);
    return good;
}

/* status of point i that removes a violation of Coulomb's law by rates F of force and dx of motion, (m, 2) each, and
   the size of the violation as a rate of motion; `status` without one. before: status on entry of `rates` */
static long admissible(const Points *p, long i, long status, long before, const double *force, const double *F,
                       const double *dx, const double *search, double negligible, double *miss)
{
    double N = N_of(p, force, i), T = T_of(p, force, i), dN = N_of(p, F, i), dT = T_of(p, F, i), along = T_of(p, dx, i);
    double compliance = (p->C[2 * i * (2 * p->m + 1)] + p->C[(2 * i + 1) * (2 * p->m + 1)]) / 2, m = mu(p, i);
    if (status == FREE) {
        *miss = N_of(p, dx, i);
        return before == FREE || !(*miss > 0) ? FREE : isinf(p->friction[i]) ? STICKS : along < 0 ? BACK : SLIDES;
    }
    if (!p->pulls[i] && N <= negligible && dN < 0) {
        *miss = -dN * compliance;
        return FREE;
    }
    if (status != STICKS) {
        *miss = fabs(along);
        return m > 0 && status * along < -search[NONE] * largest(p, T_of, dx) ? STICKS : status;
    }
    double sense = fabs(T) > m * negligible ? sign(T) : sign(dT), over = sense * dT - m * dN;
    int at_limit = !isinf(p->friction[i]) && fabs(T) >= m * ((1 - search[LIMIT]) * N - negligible);
    *miss = over * compliance;
    return at_limit && over > search[NONE] * largest(p, T_of, F) ? (long)sense : status;
}

/* change `status` (m) until rates F of force and dx of motion, (m, 2) each, satisfy Coulomb's law: first at all points
   at once, later, or if a set returns, where the violation is largest; 0 if that fails */
static int agree(const Points *p, const System *s, const long *before, const double *force, const double *search,
                 long *status, double *F, double *dx)
{
    long m = p->m, tries = (long)search[TRIES], *seen = malloc((tries + 1) * (m + 1) * sizeof(long));
    long *other = seen + tries * m;
    int good = 0;
    for (long k = 0; k < tries; k++) {
        int finite = 1, alone = k >= search[ALL_AT_ONCE];
        if (!solved(p, s, status, NULL, NULL, NULL, search[NONE], F, dx)) break;
        for (long i = 0; i < 2 * m; i++) finite &= isfinite(F[i]) != 0;
        if (!finite) break;
        double negligible = search[LIMIT] * (largest(p, N_of, force) + search[COMPARISON_LENGTH] * largest(p, N_of, F));
        double worst = 0.0, miss;
        long first = -1;
        for (long i = 0; i < m; i++) {
            other[i] = admissible(p, i, status[i], before[i], force, F, dx, search, negligible, &miss);
            if (other[i] != status[i] && (first < 0 || miss > worst)) { first = i; worst = miss; }
        }
        if (first < 0) { good = 1; break; }
        for (long j = 0; j < k; j++) alone |= !memcmp(seen + j * m, status, m * sizeof(long));
        memcpy(seen + k * m, status, m * sizeof(long));
        if (alone) status[first] = other[first];
        else memcpy(status, other, m * sizeof(long));
    }
    free(seen);
    return good;
}

/* rates F of the contact forces (m, 2) along the velocity u (m, 2), and their part outside the tangent, F - S dx;
   `status` (m) is changed until Coulomb's law holds; before: statuses of the accepted state; 0 if there are none */
int rates(long m, const double *friction, const double *pulls, const double *S, const double *C, const double *normal,
          const double *curvature, const double *u, const double *force, const long *before, const double *search,
          long *status, double *F, double *outside)
{
    Points p = {m, friction, pulls, S, C, normal, curvature};
    System s = new_system(m);
    double *dx = malloc((2 * m + 1) * sizeof(double));
    int good = condense(&p, u, force, &s) && agree(&p, &s, before, force, search, status, F, dx);
    if (good) {
        memcpy(outside, F, 2 * m * sizeof(double));
        add_product(m, -1.0, S, dx, outside);
    }
    free(dx);
    free(s.columns);
    return good;
}

/* arc length after which a status changes first, with forces and their rates (m, 2) each, infinite if none does;
   after[0]: number of that point, after[1]: its new status */
double change(long m, const double *friction, const double *pulls, const double *S, const double *C,
              const double *normal, const double *curvature, const long *status, const double *force,
              const double *rate, const double *search, long *after)
{
    Points p = {m, friction, pulls, S, C, normal, curvature};
    double first = INFINITY, negligible = search[LIMIT] * fmax(largest(&p, N_of, force), 1e-30);
    for (long i = 0; i < m; i++) {
        double N = N_of(&p, force, i), T = T_of(&p, force, i), dN = N_of(&p, rate, i), dT = T_of(&p, rate, i);
        if (status[i] != FREE && !pulls[i] && dN < 0 && negligible < N && -N / dN < first) {
            first = -N / dN;
            after[0] = i, after[1] = FREE;
        }
        for (int sense = SLIDES; status[i] == STICKS && !isinf(friction[i]) && sense >= BACK; sense -= 2) {
            double m = friction[i], margin = m * N - sense * T, closing = sense * dT - m * dN;
            if (closing > 0 && margin > search[LIMIT] * m * fabs(N) && margin / closing < first) {
                first = margin / closing;
                after[0] = i, after[1] = sense;
            }
        }
    }
    return first;
}

enum {FRICTION, ELASTIC_SLIP, PULLS, SCALE, THETA, SHIFT, PENALTY, PROPERTIES};       /* columns of properties */

/* in `out` (m, 6) for m points the normal (2), the tangent (2) and the curvature of the profile closest to them, and
   the distance at which the normal part N of their force (m, 2) acts, `Law.depth`, less their distance, which is
   reduced by `shift`. The points are `rows` (m) of positions (n, 2), of properties (n, 7) and of ranges (n, 3): first
   piece in the table, number of pieces, of lines. scale: N over the normal traction */
void frame(long m, const double *positions, const long *rows, const double *force, const double *properties,
           const long *ranges, const double *table, double *out)
{
    for (long i = 0; i < m; i++) {
        const double *p = properties + rows[i] * PROPERTIES, *f = force + 2 * i;
        const long *range = ranges + 3 * rows[i];
        double distance, *n = out + 6 * i;
        nearest(1, positions + 2 * rows[i], range[1], range[2], table + range[0] * COLUMNS, &distance, n, n + 4);
        double N = (f[0] * n[0] + f[1] * n[1]) / p[SCALE], theta = p[THETA];
        double over = (p[PULLS] > 0 ? N : fmax(N, 0.0)) / (p[PENALTY] * theta);
        double depth = theta * (p[PULLS] > 0 ? over - 1 : over > 1 ? over : 2 * sqrt(over) - 1);
        n[2] = -n[1];
        n[3] = n[0];
        n[5] = depth - (distance - p[SHIFT]);
    }
}
