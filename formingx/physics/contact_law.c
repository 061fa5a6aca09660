/* Penalty law at contact points (`Law` in contact_law.py has its equations), and arc lengths at which open points on
   straight paths reach their tools. A run asks thousands of times, for few points each time. */
#include "../tools/nearest.c"

enum {THETA, ELASTIC_SLIP, PULLS, FRICTION, SLIDES, STICKS};

/* ramp F(d) of eq. (5.13) and its derivative; of contact that does not separate max(d + theta, 0), or d + theta */
static double ramp_at(double d, double theta, int pulls, int bonded, double *slope)
{
    if (pulls) {
        *slope = bonded || d > -theta;
        return *slope * (d + theta);
    }
    *slope = fmin(fmax((d + theta) / (2 * theta), 0.0), 1.0);
    return d < theta ? theta * (*slope * *slope) : d;
}

void ramp(long points, double theta, long pulls, const double *d, const double *bonded, double *F, double *slope)
{
    for (long i = 0; i < points; i++)
        F[i] = ramp_at(d[i], theta, pulls, bonded && bonded[i], slope + i);
}

/* elastic slip g that sticking points would have at x, and its gradient dg */
void elastic_slips(long points, double theta, const double *x, const double *normal, const double *curvature,
                   const double *position, const double *distance, const double *slip, const double *closure,
                   double *g, double *dg)
{
    for (long i = 0; i < points; i++) {
        const double *n = normal + 2 * i, *from = (distance[i] > -theta ? position : closure) + 2 * i;
        double u = x[2 * i] - from[0], v = x[2 * i + 1] - from[1], slips = !isnan(u);
        if (!slips) u = v = 0.0;
        double across = n[0] * u + n[1] * v, along = n[0] * v - n[1] * u;
        double rate = slips * (1 - curvature[i] * across);
        g[i] = slip[i] + along;
        dg[2 * i] = -n[1] * rate;
        dg[2 * i + 1] = n[0] * rate;
    }
}

static double sign(double a) { return (a > 0) - (a < 0); }

/* tractions and their stiffness; `out`: force, N, T, sense, stiffness, distance and slip of the history variables,
   tangential stiffness. NULL without friction or history: distance before, g, dg; without a prediction: the expected
   distances and slips; in the first iteration: the sense before; with Coulomb's law: limit and growth. */
void tractions(long points, const double *law, const double *k, long k_step, const double *mu, long mu_step,
               const double *distance, const double *normal, const double *curvature, const double *before,
               const double *g, const double *dg, const double *expected, const double *expected_slip,
               const double *sense_before, const double *limit, const double *growth, double *out)
{
    double theta = law[THETA], *force = out, *N = out + 2 * points, *T = N + points, *sense = T + points;
    double *stiffness = sense + points, *kept_distance = stiffness + 4 * points, *kept_slip = kept_distance + points;
    double *resistance = kept_slip + points;
    for (long i = 0; i < points; i++) {
        const double *n = normal + 2 * i, t[2] = {-n[1], n[0]};
        double penalty = k[i * k_step], d = distance[i], centre = expected ? expected[i] : d, slope;
        int bonded = law[PULLS] && before && before[i] > -theta;
        double F = ramp_at(centre, theta, law[PULLS], bonded, &slope);
        double pressed = penalty * F, ahead = d - centre, stiff = penalty * slope;
        double dT[2] = {0.0, 0.0}, bent = 0.0, kept = 0.0, s = 0.0;
        N[i] = pressed + stiff * ahead;
        T[i] = sense[i] = 0.0;
        if (law[FRICTION]) {
            double predicted = expected ? expected_slip[i] : g[i], m = mu[i * mu_step], rising, most, grows;
            most = limit ? limit[i] : m * pressed;
            grows = growth ? growth[i] : m;
            if (m >= law[STICKS]) {
                s = stiff;
                rising = !law[PULLS] && fabs(centre) < theta ? penalty / (2 * theta) : 0.0;
            } else {
                s = most / law[ELASTIC_SLIP];
                rising = grows / law[ELASTIC_SLIP] * penalty * slope;
            }
            bent = T[i] = s * g[i] + rising * ahead * predicted;
            double trial = s * predicted;
            int slides = law[SLIDES] && fabs(trial) > most && !(sense_before && sign(trial) * sense_before[i] < 0);
            if (law[SLIDES]) bent = fmin(fmax(bent, -most), most);
            if (slides) {
                sense[i] = sign(trial);
                T[i] = sense[i] * (most + grows * (N[i] - pressed));
            }
            for (int a = 0; a < 2; a++)
                dT[a] = slides ? sense[i] * grows * penalty * slope * n[a]
                               : s * dg[2 * i + a] + rising * predicted * n[a];
            if (s > 0) kept = T[i] / s * (1 + 1e-9 * fabs(sense[i]));      /* a sliding point goes on sliding */
        }
        for (int a = 0; a < 2; a++) {
            force[2 * i + a] = N[i] * n[a] + T[i] * t[a];
            for (int b = 0; b < 2; b++)
                stiffness[4 * i + 2 * a + b] = n[a] * (stiff * n[b] - bent * curvature[i] * t[b])
                                             + t[a] * (pressed * curvature[i] * t[b] + dT[b]);
        }
        kept_distance[i] = bonded ? fmax(d, 0.0) : d;
        kept_slip[i] = kept;
        resistance[i] = s;
    }
}

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
double gap_closure(const double *x, const double *w, double theta, double shift, double earliest, double accuracy,
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
