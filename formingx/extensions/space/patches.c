/* Nearest points of a surface of patches (patches.py). Contact asks for the distances of all points of a sheet in each
   iteration. The nearest point of a patch is found by Newton's method. A tree of bounding boxes leaves few patches for
   each point (Ericson, Real-Time Collision Detection, 2005, chapters 5.1.5 and 6).

   Libraries with a search tree (scipy.spatial.cKDTree, VTK, dolfinx.geometry) find the nearest of points, of flat
   triangles or of boxes. None of them takes a distance to curved patches as the bound of its search. */
#include "triangle.c"
#include "box_tree.c"
#include <string.h>

enum {CONTROL_POINTS = 18, ROOM = 128, ITERATIONS = 30};

/* a function of (u, v) with its first and second derivatives */
typedef struct { double f, u, v, uu, uv, vv; } jet;

static jet mul(jet a, jet b)
{
    jet c = {a.f * b.f, a.u * b.f + a.f * b.u, a.v * b.f + a.f * b.v, a.uu * b.f + 2 * a.u * b.u + a.f * b.uu,
             a.uv * b.f + a.u * b.v + a.v * b.u + a.f * b.uv, a.vv * b.f + 2 * a.v * b.v + a.f * b.vv};
    return c;
}

static jet scale(double s, jet a)
{
    jet c = {s * a.f, s * a.u, s * a.v, s * a.uu, s * a.uv, s * a.vv};
    return c;
}

static jet over(jet a, jet b)
{
    jet c;
    c.f = a.f / b.f; c.u = (a.u - c.f * b.u) / b.f; c.v = (a.v - c.f * b.v) / b.f;
    c.uu = (a.uu - 2 * c.u * b.u - c.f * b.uu) / b.f;
    c.uv = (a.uv - c.u * b.v - c.v * b.u - c.f * b.uv) / b.f;
    c.vv = (a.vv - 2 * c.v * b.v - c.f * b.vv) / b.f;
    return c;
}

/* a^2 b / (a + b) */
static jet share(jet a, jet b)
{
    jet s = {a.f + b.f, a.u + b.u, a.v + b.v, 0, 0, 0}, zero = {0, 0, 0, 0, 0, 0};
    return s.f < 1e-13 ? zero : over(mul(mul(a, a), b), s);
}

/* position of a patch at (u, v) with its derivatives: S, u, v, uu, uv, vv */
static void patch(const double *P, double u, double v, double S[6][3])
{
    jet b[3] = {{u, 1, 0, 0, 0, 0}, {v, 0, 1, 0, 0, 0}, {1 - u - v, -1, -1, 0, 0, 0}}, s[3], c[CONTROL_POINTS];
    for (int k = 0; k < 3; k++) s[k] = mul(b[k], b[k]);
    for (int k = 0; k < 3; k++) {
        int l = (k + 1) % 3, m = (k + 2) % 3;
        jet kl = mul(b[k], b[l]), t = scale(12, s[k]);
        c[4 * k] = mul(s[k], s[k]);
        c[4 * k + 1] = scale(4, mul(s[k], kl));
        c[4 * k + 2] = scale(6, mul(s[k], s[l]));
        c[4 * k + 3] = scale(4, mul(kl, s[l]));
        c[12 + 2 * k] = mul(t, share(b[l], b[m]));              /* of the edge from k to l */
        c[13 + 2 * k] = mul(t, share(b[m], b[l]));              /* of the edge from k to m */
    }
    memset(S, 0, 18 * sizeof(double));
    for (int j = 0; j < CONTROL_POINTS; j++)
        for (int i = 0; i < 3; i++) {
            double p = P[3 * j + i];
            S[0][i] += c[j].f * p; S[1][i] += c[j].u * p; S[2][i] += c[j].v * p;
            S[3][i] += c[j].uu * p; S[4][i] += c[j].uv * p; S[5][i] += c[j].vv * p;
        }
}

/* the derivatives of the flat triangle of a patch */
static void on_flat(const double *P, double S[6][3])
{
    memset(S + 1, 0, 15 * sizeof(double));
    for (int i = 0; i < 3; i++) { S[1][i] = P[i] - P[24 + i]; S[2][i] = P[12 + i] - P[24 + i]; }
}

/* the step along an edge of the triangle that lowers the distance most; on: is (u, v) on the edges u, v, w = 0 */
static void along_an_edge(const int *on, const double *g, double A, double B, double C, double *du, double *dv)
{
    static const double ways[3][2] = {{0, 1}, {1, 0}, {1, -1}};
    double best = 0, bu = 0, bv = 0;
    for (int k = 0; k < 3; k++) {
        if (!on[k]) continue;
        double p = ways[k][0], q = ways[k][1], slope = g[0] * p + g[1] * q, h = A * p * p + 2 * B * p * q + C * q * q;
        double t = -slope / h, eu = t * p, ev = t * q;
        if ((on[0] && eu < 0) || (on[1] && ev < 0) || (on[2] && eu + ev > 1e-18)) continue;
        if (slope * t < best) { best = slope * t; bu = eu; bv = ev; }
    }
    *du = bu; *dv = bv;
}

/* the nearest point of a patch, by Newton's method from (u, v) in the triangle; returns the squared distance. It ends
   early if 4 times the decrease that Newton's method predicts would leave it above `best` */
static double project(const double *P, const double *x, double best, double u, double v, double S[6][3], double *pu,
                      double *pv)
{
    double r[3], f;
    patch(P, u, v, S);
    f = away(S[0], x, r);
    for (int it = 0; it < ITERATIONS; it++) {
        double w = 1 - u - v, g[2] = {dot(r, S[1]), dot(r, S[2])};
        double a = dot(S[1], S[1]), b = dot(S[1], S[2]), c = dot(S[2], S[2]);
        double A = a + dot(r, S[3]), B = b + dot(r, S[4]), C = c + dot(r, S[5]);
        int newton = A > 1e-3 * a && A * C - B * B > 1e-6 * a * c;
        if (!newton) { A = a; B = b; C = c; }
        double det = A * C - B * B, du = -(C * g[0] - B * g[1]) / det, dv = -(A * g[1] - B * g[0]) / det;
        int on[3] = {u <= 0, v <= 0, w <= 1e-15};
        if ((on[0] && du < 0) || (on[1] && dv < 0) || (on[2] && du + dv > 0))
            along_an_edge(on, g, A, B, C, &du, &dv);
        if (f + 4 * (g[0] * du + g[1] * dv) > best * (1 + 1e-9)) break;
        double most = 1;                                      /* stays in the triangle */
        if (du < 0 && u + most * du < 0) most = -u / du;
        if (dv < 0 && v + most * dv < 0) most = -v / dv;
        if (du + dv > 0 && most * (du + dv) > w) most = w / (du + dv);
        if (fabs(du) + fabs(dv) < 1e-13 || most * (fabs(du) + fabs(dv)) < 1e-14) break;
        int better = 0, last = newton && most == 1 && fabs(du) + fabs(dv) < 1e-6;    /* quadratic convergence */
        for (int half = 0; half < 12; half++, most /= 2) {
            double nu = u + most * du, nv = v + most * dv, T[6][3], s[3];
            if (nu < 1e-15) nu = 0;
            if (nv < 1e-15) nv = 0;
            if (nu + nv > 1 - 1e-15) { double all = nu + nv; nu /= all; nv /= all; }
            patch(P, nu, nv, T);
            double e = away(T[0], x, s);
            if (e <= f * (1 + 1e-15)) {
                better = e < f * (1 - 1e-14);
                u = nu; v = nv; f = e;
                memcpy(S, T, 18 * sizeof(double)); memcpy(r, s, 3 * sizeof(double));
                break;
            }
        }
        if (!better || last) break;
    }
    *pu = u; *pv = v;
    return f;
}

static double to_box(const double *b, const double *x)
{
    double s = 0;
    for (int i = 0; i < 3; i++) {
        double d = fmax(fmax(b[i] - x[i], x[i] - b[3 + i]), 0.0);
        s += d * d;
    }
    return s;
}

/* Hessian of the distance d at a nearest point with derivatives S and unit normal N: -K / (1 + K d) for the two
   principal curvatures K of the surface, in their directions */
static void curved(double S[6][3], const double *N, double d, double *H)
{
    double e[3], h[3], a = sqrt(dot(S[1], S[1]));
    for (int i = 0; i < 3; i++) e[i] = S[1][i] / a;
    cross(N, e, h);
    double p = dot(S[2], e), q = dot(S[2], h);                /* [a p; 0 q]: derivative in the tangent frame */
    double L = dot(S[3], N), M = dot(S[4], N), R = dot(S[5], N);
    double k11 = L / (a * a), k12 = (M / a - L * p / (a * a)) / q;
    double k22 = (R - 2 * p * M / a + p * p * L / (a * a)) / (q * q);
    double m = (k11 + k22) / 2, g = sqrt((k11 - k22) * (k11 - k22) / 4 + k12 * k12), K[2] = {m + g, m - g}, T[2];
    for (int i = 0; i < 2; i++) T[i] = K[i] / fmax(1 + K[i] * d, 0.1);
    double f1 = g > 1e-14 * fabs(m) + 1e-300 ? (T[0] - T[1]) / (2 * g) : 0, f0 = (T[0] + T[1]) / 2 - f1 * m;
    double t11 = f0 + f1 * k11, t12 = f1 * k12, t22 = f0 + f1 * k22;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            H[3 * i + j] = t11 * e[i] * e[j] + t12 * (e[i] * h[j] + h[i] * e[j]) + t22 * h[i] * h[j];
}

/* Hessian of the distance d = -|r| from an edge or a corner at the end of r, with derivatives S at (u, v) and the unit
   normal n: (1 - n n^T - t t^T share) / d, where t is the direction of the edge; its curvature gives the share */
static void sharp(double S[6][3], const double *uv, const double *n, const double *r, double d, double *H)
{
    int on[3] = {uv[0] <= 1e-9, uv[1] <= 1e-9, uv[0] + uv[1] >= 1 - 1e-9};
    double t[3], bend[3], share = 0;
    for (int i = 0; i < 3; i++) {
        t[i] = on[0] ? S[2][i] : on[1] ? S[1][i] : S[1][i] - S[2][i];
        bend[i] = on[0] ? S[5][i] : on[1] ? S[3][i] : S[3][i] - 2 * S[4][i] + S[5][i];
    }
    double square = dot(t, t), along = dot(bend, t);
    for (int i = 0; i < 3; i++) bend[i] -= along * t[i] / square;
    for (int i = 0; i < 3; i++) t[i] /= sqrt(square);
    if (on[0] + on[1] + on[2] == 1) share = 1 / fmax(1 - dot(r, bend) / square, 0.1);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            H[3 * i + j] = ((i == j) - n[i] * n[j] - share * t[i] * t[j]) / d;
}

/* nearest patch of a point found so far: squared distance, squareness, number, (u, v), position with derivatives */
typedef struct { double best, square; long found; double uv[2], S[6][3]; } candidate;

/* Compare patch t. Of patches that are equally near, as at an edge, the one that meets the line to the point most
   squarely counts: it gives the sign. */
static void compare(candidate *near, const double *x, long t, const double *bulges, const double *patches)
{
    const double *P = patches + 3 * CONTROL_POINTS * t;
    double u, v, S[6][3], N[3], r[3];
    flat(P, P + 12, P + 24, x, &u, &v);
    for (int i = 0; i < 3; i++) S[0][i] = u * P[i] + v * P[12 + i] + (1 - u - v) * P[24 + i];
    double f = away(S[0], x, r), least = fmax(sqrt(f) - bulges[t], 0);    /* of the distance to the patch */
    if (least * least > near->best * (1 + 1e-9)) return;
    if (bulges[t] == 0) on_flat(P, S);
    else f = project(P, x, near->best, u, v, S, &u, &v);
    if (f > near->best * (1 + 1e-9)) return;
    cross(S[1], S[2], N);
    away(S[0], x, r);
    double s = fabs(dot(r, N)) / sqrt(dot(N, N) * fmax(f, 1e-300));
    if (f < near->best * (1 - 1e-9) || s > near->square) {
        near->best = fmin(near->best, f);
        near->square = s; near->found = t; near->uv[0] = u; near->uv[1] = v;
        memcpy(near->S, S, sizeof near->S);
    }
}

/* signed distance (positive inside), unit normal (into the tool), Hessian and nearest triangle of n points. bulges: the
   largest distance of the control points of each patch from its flat triangle, 0 for a flat patch. `triangle` comes with
   a guess for each point, or -1: the search begins there. `edge` is 1 if the nearest point is on a sharp edge. */
void nearest(long n, const double *X, const double *nodes, const long *links, const long *items, const double *boxes,
             const double *bulges, const double *patches, double *distance, double *normal, double *hessian,
             long *triangle, long *edge)
{
    for (long k = 0; k < n; k++) {
        const double *x = X + 3 * k;
        candidate near = {1e300, 0, -1, {0, 0}, {{0}}};
        long stack[ROOM], guess = triangle[k]; int top = 1;
        double away_by[ROOM];                                 /* squared distances of the nodes on the stack */
        if (guess >= 0) compare(&near, x, guess, bulges, patches);
        stack[0] = 0; away_by[0] = to_box(nodes, x);
        while (top--) {
            long me = stack[top];
            if (away_by[top] > near.best * (1 + 1e-9)) continue;
            if (links[2 * me] >= 0) {
                long a = links[2 * me], b = links[2 * me + 1];
                double p = to_box(nodes + 6 * a, x), q = to_box(nodes + 6 * b, x);
                int other = p < q;                            /* the nearer one first */
                stack[top] = other ? b : a; away_by[top++] = other ? q : p;
                stack[top] = other ? a : b; away_by[top++] = other ? p : q;
                continue;
            }
            long first = -1 - links[2 * me];
            for (long j = first; j < first + links[2 * me + 1]; j++)
                if (items[j] != guess && to_box(boxes + 6 * items[j], x) <= near.best * (1 + 1e-9))
                    compare(&near, x, items[j], bulges, patches);
        }
        double N[3], r[3];
        cross(near.S[1], near.S[2], N);
        double size = sqrt(dot(N, N));
        for (int i = 0; i < 3; i++) { N[i] /= size; r[i] = x[i] - near.S[0][i]; }
        double s = dot(r, N), d = sqrt(dot(r, r)), *n3 = normal + 3 * k, *H = hessian + 9 * k;
        distance[k] = d = s > 0 ? -d : d;
        triangle[k] = near.found;
        int crease = near.square < 1 - 1e-7 && fabs(d) > 1e-7 * sqrt(size);
        edge[k] = crease;
        if (!normal) continue;
        for (int i = 0; i < 3; i++) n3[i] = crease ? r[i] / d : -N[i];
        memset(H, 0, 9 * sizeof(double));
        if (crease) sharp(near.S, near.uv, n3, r, d, H);
        else if (bulges[near.found] > 0) curved(near.S, N, d, H);
    }
}

/* positions and derivatives (n, 6, 3) of n points (u, v) on the patches of the given triangles */
void evaluate(long n, const long *triangles, const double *patches, const double *uv, double *out)
{
    for (long k = 0; k < n; k++)
        patch(patches + 3 * CONTROL_POINTS * triangles[k], uv[2 * k], uv[2 * k + 1], (double (*)[3])(out + 18 * k));
}
