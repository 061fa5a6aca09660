/* Arc lengths at which open points on straight paths reach their tools, for tools of lines and arcs. The prediction of
   contact events asks hundreds of times in a run, for few points each time. */
#include "../tools/nearest.c"

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
