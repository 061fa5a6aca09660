/* Search for overlapping boxes. A run tests the boundary of the body for self-intersection in each state. */

/* number of pairs (i < j) of boxes that overlap or touch; the first `most` are written to `pairs` */
long overlaps(long n, const double *low, const double *high, long most, long *pairs)
{
    long found = 0;
    for (long i = 0; i < n; i++)
        for (long j = i + 1; j < n; j++) {
            const double *a = low + 2 * i, *b = high + 2 * i, *c = low + 2 * j, *d = high + 2 * j;
            if (!(a[0] <= d[0] && c[0] <= b[0] && a[1] <= d[1] && c[1] <= b[1])) continue;
            if (found < most) {
                pairs[2 * found] = i;
                pairs[2 * found + 1] = j;
            }
            found++;
        }
    return found;
}
