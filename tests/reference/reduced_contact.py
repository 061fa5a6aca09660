"""Equations of reduced contact in array operations, as a reference for those in C (`compiled_contact`)."""

from dataclasses import dataclass

import numpy as np

from formingx.contact.step_limit import LIMITS
from formingx.extensions.contact_events.reduced_contact import StatusSearch
from formingx.physics.contact_law import ContactStatus

SEARCH = StatusSearch()


@dataclass
class ReferencePoints:
    """m contact points with the arrays of `Points`: friction, elastic slip, adhesion (m), S (m, 2, 2), C (2 m, 2 m)."""

    friction: np.ndarray
    elastic_slip: np.ndarray
    pulls: np.ndarray
    S: np.ndarray
    C: np.ndarray

    @property
    def mu(self):
        """Coefficient of friction of each point, 0 for stick."""
        return np.where(self.friction < np.inf, self.friction, 0.0)

    def parts(self, force, near):
        """Components of vectors normal and tangential to the tools."""
        return np.einsum("ni,ni->n", force, near.normal), np.einsum("ni,ni->n", force, near.tangent)

    def forces_at_end(self, u, status, near, force, to):
        """As `Points.forces_at_end`."""
        N = self.parts(force, near)[0]
        slips = np.divide(self.elastic_slip, self.mu * N, out=np.zeros(len(N)), where=self.mu * N > 0)
        system = self.condensed(u + (self.C @ force.ravel()).reshape(u.shape), near,
                                force * (status != ContactStatus.FREE)[:, None])
        try:
            F, dx = self.solved(system, status, near, to, slips)
        except np.linalg.LinAlgError:
            return force, np.full(force.shape, np.nan)
        return F, F - force - np.einsum("nij,nj->ni", self.S, dx)

    def rates(self, u, status, near, force):
        """As `Points.rates`."""
        (N, T), system = self.parts(force, near), self.condensed(u, near, force)
        here = status != ContactStatus.FREE
        slack = here & (np.abs(N).max(initial=0.0) * SEARCH.limit_tolerance >= N) & ~self.pulls
        for begin in (status, np.where(slack, ContactStatus.FREE, status)):
            found = self.agreed(system, begin.copy(), near, N, T, here)
            if found is not None:
                F, dx, after = found
                return F, F - np.einsum("nij,nj->ni", self.S, dx), after
        return None

    def agreed(self, system, status, near, N, T, here):
        """Rates of forces and positions, and statuses that satisfy Coulomb's law; None if the search failed."""
        seen, mu, compliance = set(), self.mu, self.C.diagonal().reshape(len(N), -1).mean(1)
        for k in range(SEARCH.max_trials):
            try:
                F, dx = self.solved(system, status, near)
            except np.linalg.LinAlgError:
                return None
            (dN, dT), (into, along), held = self.parts(F, near), self.parts(dx, near), status != ContactStatus.FREE
            negligible = SEARCH.limit_tolerance * (np.abs(N).max() + LIMITS.min_length * np.abs(dN).max())
            other, miss = status.copy(), np.zeros(len(N))
            slides = held & (status != ContactStatus.STICKS) & (mu > 0)
            turns = slides & (status * along < -SEARCH.negligible_rate * np.abs(along).max())
            other[turns], miss[turns] = ContactStatus.STICKS, np.abs(along[turns])
            most = mu * ((1 - SEARCH.limit_tolerance) * N - negligible)
            at_limit = held & (status == ContactStatus.STICKS) & (self.friction < np.inf) & (np.abs(T) >= most)
            sense = np.where(np.abs(T) > mu * negligible, np.sign(T), np.sign(dT))
            over = sense * dT - mu * dN
            slips = at_limit & (over > SEARCH.negligible_rate * np.abs(dT).max())
            other[slips], miss[slips] = sense[slips], (over * compliance)[slips]
            opens = held & ~self.pulls & (negligible >= N) & (dN < 0)
            other[opens], miss[opens] = ContactStatus.FREE, -(dN * compliance)[opens]
            closes = here & ~held & (into > 0)
            sense = np.where(along[closes] < 0, ContactStatus.SLIDES_BACK, ContactStatus.SLIDES)
            other[closes] = np.where(self.friction[closes] < np.inf, sense, ContactStatus.STICKS)
            miss[closes] = into[closes]
            changes = np.flatnonzero(other != status)
            if not len(changes):
                return F, dx, status
            if k >= SEARCH.simultaneous_trials or status.tobytes() in seen:
                changes = changes[[np.argmax(miss[changes])]]
            seen.add(status.tobytes())
            status[changes] = other[changes]
        return None

    def change(self, status, near, force, rate):
        """As `Points.change`."""
        (N, T), (dN, dT), held = self.parts(force, near), self.parts(rate, near), status != ContactStatus.FREE
        negligible = SEARCH.limit_tolerance * max(np.abs(N).max(initial=0.0), 1e-30)
        times, other = np.full(len(status), np.inf), status.copy()
        opens = held & ~self.pulls & (dN < 0) & (negligible < N)
        times[opens], other[opens] = -N[opens] / dN[opens], ContactStatus.FREE
        k = np.flatnonzero(held & (status == ContactStatus.STICKS) & (self.friction < np.inf))
        mu = self.friction[k]
        for sense in (ContactStatus.SLIDES, ContactStatus.SLIDES_BACK):
            margin, closing = mu * N[k] - sense * T[k], sense * dT[k] - mu * dN[k]
            slips = (closing > 0) & (margin > SEARCH.limit_tolerance * mu * np.abs(N[k]))
            t = np.divide(margin, closing, out=np.full(len(k), np.inf), where=slips)
            first = t < times[k]
            times[k[first]], other[k[first]] = t[first], sense
        first = int(np.argmin(times))
        after = status.copy()
        after[first] = other[first]
        return float(times[first]), after

    def condensed(self, u, near, force):
        """Motion by u (2 m), compliance (2 m, 2 m), both without S, and stiffness of forces that rotate (m, 2, 2)."""
        (N, T), n, t = self.parts(force, near), near.normal, near.tangent
        turn = near.curvature[:, None, None] * ((N[:, None] * t - T[:, None] * n)[:, :, None] * t[:, None, :])
        size = len(self.C)
        CK = np.einsum("xni,nij->xnj", self.C.reshape(size, *u.shape), self.S - turn).reshape(size, size)
        found = np.linalg.solve(np.eye(size) - CK, np.column_stack([u.ravel(), self.C]))
        return found[:, 0], found[:, 1:], turn

    def solved(self, system, status, near, to=None, slips=None):
        """Forces, or without `to` their rates, and motions of the points at given statuses, (m, 2) each."""
        free, C, turn = system
        held, m = status != ContactStatus.FREE, len(status)
        stuck = held & (status == ContactStatus.STICKS) & (self.friction > 0)
        sticks, slides = np.flatnonzero(stuck), np.flatnonzero(held & ~stuck)
        point = np.concatenate([sticks, sticks, slides])
        into = np.concatenate([near.normal[sticks], near.tangent[sticks], near.normal[slides]])
        along = (self.mu * status)[slides, None] * near.tangent[slides]
        against = np.concatenate([into[:2 * len(sticks)], near.normal[slides] + along])
        each, columns = np.arange(len(point))[:, None], 2 * point[:, None] + np.arange(2)
        A, B = np.zeros((len(point), len(free))), np.zeros((len(free), len(point)))
        A[each, columns], B[columns, each] = into, against
        compliance, a = A @ C @ B, np.zeros(len(point))
        largest = np.abs(compliance).max(1, initial=0.0)
        most = largest.max(initial=0.0)
        stiff = np.flatnonzero(largest < SEARCH.negligible_rate * most)
        compliance[stiff, stiff] = most
        if to is not None:
            n = 2 * len(sticks)
            a[:n], a[n:] = np.einsum("ni,ni->n", to[point[:n]], into[:n]), near.beyond[slides]
        if slips is not None:
            k = each[len(sticks):2 * len(sticks), 0]
            compliance[k, k] += slips[sticks]
        amounts = np.linalg.solve(compliance, A @ free - a)
        dx = (free - C @ (B @ amounts)).reshape(m, 2)
        return (B @ amounts).reshape(m, 2) + np.einsum("nij,nj->ni", turn, dx), dx
