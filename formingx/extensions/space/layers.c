/* Crossings of a surface of triangles with itself: edges that pass through triangles with which they share no vertex.
   A tree of boxes leaves few pairs of triangles, most of them near neighbours in one layer. */
#include "triangle.c"
#include "box_tree.c"
#include <stdlib.h>

typedef struct {
    const double *P, *boxes, *nodes;
    const long *triangles, *links, *items;
    double least, wall, share;
    const double *X;
    double crease;
    long most, count;
    double *found;
} search;

static int apart(const double *a, const double *b)
{
    for (int i = 0; i < 3; i++)
        if (a[i] > b[3 + i] || b[i] > a[3 + i]) return 1;
    return 0;
}

static void normal_of(const double *a, const double *b, const double *c, double *n)
{
    double p[3], q[3];
    away(b, a, p); away(c, a, q);
    cross(p, q, n);
}

/* Is x, a point of the plane of a triangle with the normal n, inside it? */
static int inside(const double **corner, const double *n, const double *x)
{
    for (int k = 0; k < 3; k++) {
        double m[3];
        normal_of(corner[k], corner[(k + 1) % 3], x, m);
        if (dot(m, n) <= 0) return 0;
    }
    return 1;
}

/* The edges of triangle s that pass through triangle t. The depth of an edge is the smaller distance of its ends from
   the plane; it counts from max(least, min(wall, share of the longest edge of s)) on, and from max(least, wall) on if
   the triangles are neighbours: nearer than `crease` to each other in the reference configuration X. */
static void pass_through(search *all, long s, long t)
{
    const double *corner[3], *end[3];
    double n[3], d[3], r[3], size, longest = 0;
    for (int k = 0; k < 3; k++) {
        corner[k] = all->P + 3 * all->triangles[3 * t + k];
        end[k] = all->P + 3 * all->triangles[3 * s + k];
    }
    normal_of(corner[0], corner[1], corner[2], n);
    size = sqrt(dot(n, n));
    if (size == 0) return;
    for (int k = 0; k < 3; k++) {
        longest = fmax(longest, sqrt(away(end[k], end[(k + 1) % 3], r)));
        away(end[k], corner[0], r);
        d[k] = dot(r, n) / size;
    }
    double limit = fmax(all->least, fmin(all->wall, all->share * longest)), middle[2][3] = {{0}};
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 3; i++) {
            middle[0][i] += all->X[3 * all->triangles[3 * s + k] + i] / 3;
            middle[1][i] += all->X[3 * all->triangles[3 * t + k] + i] / 3;
        }
    if (away(middle[0], middle[1], r) < all->crease * all->crease) limit = fmax(all->least, all->wall);
    for (int k = 0; k < 3; k++) {
        int l = (k + 1) % 3;
        double depth = fmin(fabs(d[k]), fabs(d[l])), x[3];
        if (d[k] * d[l] >= 0 || depth <= limit) continue;
        for (int i = 0; i < 3; i++) x[i] = end[k][i] + d[k] / (d[k] - d[l]) * (end[l][i] - end[k][i]);
        if (!inside(corner, n, x)) continue;
        if (all->count < all->most) {
            double *row = all->found + 4 * all->count;
            for (int i = 0; i < 3; i++) row[i] = x[i];
            row[3] = depth;
        }
        all->count++;
    }
}

static void compare(search *all, long s, long t)
{
    const long *a = all->triangles + 3 * s, *b = all->triangles + 3 * t;
    if (apart(all->boxes + 6 * s, all->boxes + 6 * t)) return;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            if (a[i] == b[j]) return;
    pass_through(all, s, t);
    pass_through(all, t, s);
}

/* all pairs of triangles below two nodes of the tree, or below one */
static void descend(search *all, long a, long b)
{
    if (a != b && apart(all->nodes + 6 * a, all->nodes + 6 * b)) return;
    const long *p = all->links + 2 * a, *q = all->links + 2 * b;
    if (p[0] < 0 && q[0] < 0) {
        for (long i = -1 - p[0]; i < -1 - p[0] + p[1]; i++)
            for (long j = a == b ? i + 1 : -1 - q[0]; j < -1 - q[0] + q[1]; j++)
                compare(all, all->items[i], all->items[j]);
    } else if (a == b) {
        descend(all, p[0], p[0]); descend(all, p[0], p[1]); descend(all, p[1], p[1]);
    } else if (p[0] >= 0) {
        descend(all, p[0], b); descend(all, p[1], b);
    } else {
        descend(all, a, q[0]); descend(all, a, q[1]);
    }
}

/* Number of crossings of the m triangles (m, 3) with corners P; the first `most` are written to `found` (most, 4) as
   place and depth. Returns -1 if there is no memory. */
long crossings(long m, const double *P, const long *triangles, double least, double wall, double share,
               const double *X, double crease, long most, double *found)
{
    double *boxes = malloc(6 * m * sizeof(double)), *nodes = malloc(12 * m * sizeof(double));
    long *links = malloc(4 * m * sizeof(long)), *items = malloc(m * sizeof(long)), count = -1;
    if (boxes && nodes && links && items) {
        for (long t = 0; t < m; t++)
            for (int i = 0; i < 3; i++) {
                double a = P[3 * triangles[3 * t] + i], b = P[3 * triangles[3 * t + 1] + i];
                double c = P[3 * triangles[3 * t + 2] + i];
                boxes[6 * t + i] = fmin(a, fmin(b, c)); boxes[6 * t + 3 + i] = fmax(a, fmax(b, c));
            }
        build(m, boxes, nodes, links, items);
        search all = {P, boxes, nodes, triangles, links, items, least, wall, share, X, crease, most, 0, found};
        descend(&all, 0, 0);
        count = all.count;
    }
    free(boxes); free(nodes); free(links); free(items);
    return count;
}
