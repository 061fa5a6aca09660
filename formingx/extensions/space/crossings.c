/* Points on the wrong side of a sheet. A ray from a point along z crosses the triangles of the sheet. The sum of the
   signs of the crossings says on which side of the sheet the point is. */
#include "triangle.c"
static long cell(double x, double low, double size, long n)
{
    double k = floor((x - low) / size);
    return k < 0 ? 0 : k >= n ? n - 1 : (long) k;
}

/* n points x (n, 3), sorted into cells of a grid of nx by ny squares of a size from (low_x, low_y): `first` (nx ny + 1)
   and `order` (n). m triangles (m, 3) with corners P. For each point: the sum of signs of the triangles above it, that
   of all on its ray along z, and their number */
void crossings(long n, const double *x, long m, const double *P, const long *triangles, const long *first,
               const long *order, double low_x, double low_y, double size, long nx, long ny, long *above, long *all,
               long *number)
{
    for (long k = 0; k < n; k++) above[k] = all[k] = number[k] = 0;
    for (long t = 0; t < m; t++) {
        const long *corner = triangles + 3 * t;
        const double *a = P + 3 * corner[0], *b = P + 3 * corner[1], *c = P + 3 * corner[2];
        double nz = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if (nz == 0) continue;
        long i0 = cell(fmin(a[0], fmin(b[0], c[0])), low_x, size, nx), i1 = cell(fmax(a[0], fmax(b[0], c[0])), low_x,
                                                                                  size, nx);
        long j0 = cell(fmin(a[1], fmin(b[1], c[1])), low_y, size, ny), j1 = cell(fmax(a[1], fmax(b[1], c[1])), low_y,
                                                                                  size, ny);
        for (long i = i0; i <= i1; i++)
            for (long j = j0; j <= j1; j++)
                for (long q = first[i * ny + j]; q < first[i * ny + j + 1]; q++) {
                    long k = order[q];
                    const double *p = x + 3 * k;
                    double e0 = (b[0] - p[0]) * (c[1] - p[1]) - (b[1] - p[1]) * (c[0] - p[0]);
                    double e1 = (c[0] - p[0]) * (a[1] - p[1]) - (c[1] - p[1]) * (a[0] - p[0]);
                    double e2 = nz - e0 - e1;
                    int s = nz > 0 ? 1 : -1;
                    if (s * e0 < 0 || s * e1 < 0 || s * e2 < 0) continue;
                    double z = (e0 * a[2] + e1 * b[2] + e2 * c[2]) / nz;
                    all[k] += s;
                    number[k]++;
                    if (z > p[2]) above[k] += s;
                }
    }
}

/* square distance of a point p from triangle t */
static double from_triangle(const double *p, const double *P, const long *triangles, long t)
{
    const double *c[3];
    double u, v, y[3], r[3];
    for (int i = 0; i < 3; i++) c[i] = P + 3 * triangles[3 * t + i];
    flat(c[0], c[1], c[2], p, &u, &v);
    for (int i = 0; i < 3; i++) y[i] = u * c[0][i] + v * c[1][i] + (1 - u - v) * c[2][i];
    return away(y, p, r);
}

/* distance of n points x (n, 3) from the nearest of m triangles (m, 3) with corners P, its longest edge and its number;
   `spheres` (m, 4) has room for centre and radius of the triangles */
void distances(long n, const double *x, long m, const double *P, const long *triangles, double *spheres,
               double *distance, double *longest, long *nearest)
{
    double r[3];
    for (long t = 0; t < m; t++) {
        double *s = spheres + 4 * t, square = 0;
        for (int i = 0; i < 3; i++)
            s[i] = (P[3 * triangles[3 * t] + i] + P[3 * triangles[3 * t + 1] + i] + P[3 * triangles[3 * t + 2] + i]) / 3;
        for (int i = 0; i < 3; i++) square = fmax(square, away(P + 3 * triangles[3 * t + i], s, r));
        s[3] = sqrt(square);
    }
    for (long k = 0; k < n; k++) {
        const double *p = x + 3 * k, *c[3];
        long best = 0;
        double least = 1e300;
        for (long t = 0; t < m; t++) {
            double square = away(spheres + 4 * t, p, r);
            if (square < least) { least = square; best = t; }
        }
        least = from_triangle(p, P, triangles, best);
        double root = sqrt(least);
        for (long t = 0; t < m; t++) {
            double reach = root + spheres[4 * t + 3];
            if (away(spheres + 4 * t, p, r) >= reach * reach) continue;
            double square = from_triangle(p, P, triangles, t);
            if (square < least) { least = square; root = sqrt(least); best = t; }
        }
        for (int i = 0; i < 3; i++) c[i] = P + 3 * triangles[3 * best + i];
        longest[k] = sqrt(fmax(away(c[0], c[1], r), fmax(away(c[1], c[2], r), away(c[2], c[0], r))));
        distance[k] = root;
        nearest[k] = best;
    }
}

/* is each of n points x (n, 3) farther than a distance from all m points P (m, 3)? `found` (n) is 1 or 0 */
void far_off(long n, const double *x, long m, const double *P, double distance, long *found)
{
    for (long k = 0; k < n; k++) {
        const double *p = x + 3 * k;
        double square = distance * distance;
        found[k] = 1;
        for (long j = 0; j < m; j++) {
            double a = P[3 * j] - p[0], b = P[3 * j + 1] - p[1], c = P[3 * j + 2] - p[2];
            if (a * a + b * b + c * c <= square) { found[k] = 0; break; }
        }
    }
}
