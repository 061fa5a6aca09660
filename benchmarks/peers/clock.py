"""Times, sizes and maxima for the scripts of all codes. Standard library only."""

import json
import resource
import sys
import time


class Clock:
    """Processor and wall seconds since its creation, or since the last lap."""

    def __init__(self):
        self.lap()

    def lap(self):
        now = time.process_time(), time.perf_counter()
        before, self._last = getattr(self, "_last", now), now
        return [b - a for a, b in zip(before, now)]


def sizes():
    """Return the elements along the radius and through the thickness, from the command line."""
    return int(sys.argv[1]), int(sys.argv[2])


def report(setup, path, **numbers):
    """Print the result of a run as one line of JSON. setup, path: (CPU, wall) seconds; memory: peak, MB."""
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps({"setup_cpu": setup[0], "setup_wall": setup[1], "path_cpu": path[0], "path_wall": path[1],
                      "memory": memory, **numbers}))


def maximum(x, y, slopes):
    """Return the first maximum of the cubics through points with slopes dy/dx."""
    for k in range(len(x) - 1):
        if slopes[k] > 0 > slopes[k + 1]:
            h, rise = x[k + 1] - x[k], y[k + 1] - y[k]
            a, b = h * (slopes[k] + slopes[k + 1]) - 2 * rise, 3 * rise - h * (2 * slopes[k] + slopes[k + 1])
            roots = [t for t in ((-b + sign * (b * b - 3 * a * h * slopes[k]) ** 0.5) / (3 * a) for sign in (1, -1))
                     if 0 <= t <= 1]
            return max(y[k] + t * (h * slopes[k] + t * (b + t * a)) for t in roots)
    return None
