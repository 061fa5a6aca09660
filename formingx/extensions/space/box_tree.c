/* Tree of bounding boxes (Ericson, Real-Time Collision Detection, 2005, chapter 6). */
#include <math.h>

enum {LEAF = 4};

static double middle(const double *box, int axis) { return box[axis] + box[3 + axis]; }

/* sort items so that the first k boxes lie before the others along an axis (quickselect) */
static void divide(long n, long *items, const double *box, int axis, long k)
{
    long lo = 0, hi = n - 1;
    while (lo < hi) {
        double pivot = middle(box + 6 * items[(lo + hi) / 2], axis);
        long i = lo, j = hi;
        while (i <= j) {
            while (middle(box + 6 * items[i], axis) < pivot) i++;
            while (middle(box + 6 * items[j], axis) > pivot) j--;
            if (i <= j) { long t = items[i]; items[i] = items[j]; items[j] = t; i++; j--; }
        }
        if (k <= j) hi = j; else if (k >= i) lo = i; else break;
    }
}

static long branch(long first, long n, const double *box, double *nodes, long *links, long *items, long *used)
{
    long me = (*used)++;
    double *b = nodes + 6 * me;
    for (int i = 0; i < 3; i++) { b[i] = 1e300; b[3 + i] = -1e300; }
    for (long k = first; k < first + n; k++)
        for (int i = 0; i < 3; i++) {
            b[i] = fmin(b[i], box[6 * items[k] + i]); b[3 + i] = fmax(b[3 + i], box[6 * items[k] + 3 + i]);
        }
    if (n <= LEAF) { links[2 * me] = -1 - first; links[2 * me + 1] = n; return me; }
    int axis = 0;
    for (int i = 1; i < 3; i++) if (b[3 + i] - b[i] > b[3 + axis] - b[axis]) axis = i;
    divide(n, items + first, box, axis, n / 2);
    links[2 * me] = branch(first, n / 2, box, nodes, links, items, used);
    links[2 * me + 1] = branch(first + n / 2, n - n / 2, box, nodes, links, items, used);
    return me;
}

/* tree of n boxes (n, 6): the boxes of its nodes (2 n, 6), their children or leaves (2 n, 2), order of the items (n) */
long build(long n, const double *box, double *nodes, long *links, long *items)
{
    long used = 0;
    for (long k = 0; k < n; k++) items[k] = k;
    branch(0, n, box, nodes, links, items, &used);
    return used;
}
