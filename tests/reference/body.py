"""A body of such elements under pressure, and its path at given pole heights."""

import numpy as np

from . import element


def read(file):
    """(nodes (n, 2), triangles (m, 6), {boundary: edges (k, 3)}) of a text file with `numbering corners`; 0-based."""
    with open(file) as stream:
        lines = [line.split("#")[0].split() for line in stream]
    lines = [words for words in lines if words]
    assert lines[:2] == [["six-node", "triangles", "2"], ["numbering", "corners"]] and lines.pop() == ["end"]
    nodes, triangles, boundaries, k = {}, [], {}, 2
    while k < len(lines):
        kind, count, rows = lines[k][0], int(lines[k][1]), lines[k + 1:k + 1 + int(lines[k][1])]
        if kind == "nodes":
            nodes = {int(n): (float(r), float(z)) for n, r, z in rows}
        elif kind == "elements":
            triangles += [[int(n) for n in row[1:]] for row in rows]
        else:
            boundaries[lines[k][2]] = [[int(n) for n in row] for row in rows]
        k += count + 1
    at = {n: i for i, n in enumerate(nodes)}
    return (np.array(list(nodes.values())), np.array([[at[n] for n in row] for row in triangles]),
            {name: np.array([[at[n] for n in row] for row in rows]) for name, rows in boundaries.items()})


class Body:
    """Residual f - q p (3.1.15) and tangent (3.2.4) of a mesh: u has shape (n, 2), forces shape (2 n,).

    law: for the seven points; penalty: for `points`; loaded: edges under the pressure q.
    """

    def __init__(self, nodes, triangles, loaded, law, penalty, points):
        self.nodes, self.triangles, self.loaded = nodes, triangles, loaded
        self.parts = [(law, 7), (penalty, points)]

    def residual(self, u, q):
        """(f - q p, its derivative by u, p)."""
        n = u.size
        f, p, K = np.zeros(n), np.zeros(n), np.zeros((n, n))
        every = np.stack([2 * self.triangles, 2 * self.triangles + 1], 2).reshape(-1, 12)
        for law, points in self.parts:
            fe, Ke = element.body(self.nodes[self.triangles], u[self.triangles], law, points)
            np.add.at(f, every, fe)
            np.add.at(K, (every[:, :, None], every[:, None, :]), Ke)
        for row in self.loaded:
            dofs = np.stack([2 * row, 2 * row + 1], 1).ravel()
            pe, Ke = element.load((self.nodes + u)[row])
            p[dofs] += pe
            K[np.ix_(dofs, dofs)] -= q * Ke
        return f - q * p, K, p


def follow(body, held, row, heights, tolerance=1e-11):
    """[(u, q)] at the heights row . u = height: Newton on u and q together, so a pressure maximum is no obstacle.

    held: numbers of the displacements that are 0. A height that is too far is reached by halves.
    """
    free = np.setdiff1d(np.arange(body.nodes.size), held)
    states, done, i = [], [(np.zeros(body.nodes.shape), 0.0, 0.0)], 0
    goal = list(heights)[::-1]
    while goal:
        (u, q, h) = done[-1]
        if len(done) > 1:                                           # along the chord of the last two
            u0, q0, h0 = done[-2]
            s = (goal[-1] - h) / (h - h0)
            u, q = u + s * (u - u0), q + s * (q - q0)
        found = _newton(body, free, row, goal[-1], u, q, tolerance)
        i += 1
        assert i < 300, "the path cannot be followed"
        if found is None:
            goal.append((goal[-1] + h) / 2)
            continue
        done.append((*found, goal[-1]))
        if goal.pop() in heights:
            states.append(found)
    return states


def _newton(body, free, row, height, u, q, tolerance):
    u, n = u.copy(), len(free)
    for _ in range(12):
        with np.errstate(all="ignore"):          # a wild guess: refused below
            F, K, p = body.residual(u, q)
        if not np.isfinite(K).all():
            return None
        A = np.block([[K[np.ix_(free, free)], -p[free, None]], [row[None, free], np.zeros((1, 1))]])
        d = np.linalg.solve(A, -np.append(F[free], row @ u.ravel() - height))
        change = np.zeros(u.size)
        change[free] = d[:n]
        u += change.reshape(u.shape)
        q += d[n]
        size = np.abs(change).max() / np.abs(u).max()
        if not np.isfinite(size) or size > 1e3:
            return None
        if size < tolerance:
            return u, q
    return None
