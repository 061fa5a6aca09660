"""Which of the points at a kink stick, slide or let go: a small problem of their own, the body between them linear.

An iteration of Newton's method takes every point to be what it was foretold to be; where points decide each other's lot that can go
round for ever. Seen from a few points the body is a small compliance, and what they do can be found without it.
"""

from __future__ import annotations

from typing import Any

import numpy as np


ITS = []
INNER = 15


class Settling:
    """The points that changed their minds in one run of Newton's method."""

    def __init__(self, problem: Any):
        self._problem = problem
        self.marked = [np.zeros(len(c.points), dtype=bool) for c in problem.touching]
        self._status: Any = None
        self.most = 40
        self.failed = 0
        self.inner = 0

    def look(self) -> None:
        now = [c.status for c in self._problem.touching]
        if self._status is not None:
            for mark, a, b in zip(self.marked, self._status, now):
                mark |= a != b
        self._status = now

    def correct(self, newton: Any, step: float, slope: float) -> float:
        """Make newton.a + step b the step that suits the law at the points marked; returns the control's part."""
        problem = self._problem
        contacts = [(c, np.flatnonzero(m)) for c, m in zip(problem.touching, self.marked)]
        for trial in range(4):
            total = sum(len(i) for _, i in contacts)
            if total == 0 or total > self.most:
                return step
            found = self._solve(newton, step, slope, contacts)
            if found is None:
                self.failed += 1
                return step
            dx, dstep, more = found
            if not more:
                break
            contacts = [(c, np.flatnonzero(m)) for c, m in zip(problem.touching, self.marked)]
        newton.a.array_w[:] += dx
        return step + dstep

    def _solve(self, newton, step, slope, contacts):
        problem = self._problem
        e, v = newton.F_control, newton.gradient           # scratch ... gradient is needed
        e = problem.x.duplicate()
        v = problem.x.duplicate()
        base = newton.a.array_r.copy()
        b = newton.b.array_r
        gradient = newton.gradient.array_r
        V, S = [], []
        dofs = np.concatenate([c.dofs[i].ravel() for c, i in contacts])
        for d in dofs:
            e.set(0)
            e.array_w[d] = 1.0
            newton.solver.solve(e, v)
            V.append(v.array_r.copy())
        e.destroy(), v.destroy()
        V = np.array(V).T
        by = gradient @ V / slope
        W = V - np.outer(b, by)
        P0, C, f0, S0, scale = [], [], [], [], []
        for c, i in contacts:
            d = c.dofs[i].ravel()
            move = np.tile(c.rate * c._motion, len(i))
            P0.append(c._length * base[d] - move * step)
            C.append(c._length * W[d] + np.outer(move, by))
            f0.append(c._last[1].force[i].ravel())
            S0.append(c._last[1].stiffness[i])
            scale.append(np.repeat(c._scale[i], 2))
        P0, C, f0, S0, scale = (np.concatenate(q) for q in (P0, C, f0, S0, scale))
        C = C * scale
        y = self._inner(P0, C, f0, S0, contacts)
        if y is None:
            return None
        force, stiffness, senses = self._law(y, contacts)
        delta = scale * (force - f0)
        delta += scale * np.einsum("nij,nj->ni", stiffness - S0, y.reshape(-1, 2)).ravel()
        dx = -W @ delta
        # others that change on the way
        more = False
        full = base + dx
        whole = step + by @ delta
        for k, (c, i) in enumerate(contacts):
            P = c._length * full[c.dofs] - c.rate * c._motion * whole
            t = c.trial(P)
            new = (t.sense + 4 * (t.normal != 0)).astype(int)
            flips = (new != self._status[k]) & ~self.marked[k]
            if flips.any():
                self.marked[k] |= flips
                more = True
            c._sense = np.where(self.marked[k], t.sense, c._sense)
        return dx, by @ delta, more

    def _law(self, y, contacts):
        force, stiffness, senses, at = [], [], [], 0
        for c, i in contacts:
            t = c.trial_of(i, y[at:at + 2 * len(i)].reshape(-1, 2))
            at += 2 * len(i)
            force.append(t.force.ravel()), stiffness.append(t.stiffness), senses.append(t.sense + 4*(t.normal != 0))
        return np.concatenate(force), np.concatenate(stiffness), np.concatenate(senses)

    def _inner(self, P0, C, f0, S0, contacts):
        n = len(P0)
        y = P0.copy()
        eye = np.eye(n)
        tol = 1e-4 * min(c.law.theta for c, _ in contacts)
        for it in range(INNER):
            self.inner += 1
            force, stiffness, _ = self._law(y, contacts)
            jump = stiffness - S0
            R = y - P0 + C @ (force - f0 + np.einsum("nij,nj->ni", jump, y.reshape(-1, 2)).ravel())
            size = np.abs(R).max()
            if size < tol:
                ITS.append(it)
                return y
            J = eye.copy()
            for k in range(n // 2):
                J[:, 2*k:2*k+2] += C[:, 2*k:2*k+2] @ jump[k]
            try:
                y = y - np.linalg.solve(J, R)
            except np.linalg.LinAlgError:
                return None
            if not np.isfinite(y).all():
                return None
        return None
