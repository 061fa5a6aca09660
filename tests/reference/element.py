"""The six-node axisymmetric element of Song (1993): residual and stiffness by hand, section by section.

Nodes: corners counter-clockwise, then the middles of edges 1-2, 2-3, 3-1. Strains and stresses are held as
(11, 22, 12, 33), shape (4, m) for m elements at once; the components 12 and 21 are equal and vary together.
"""

import numpy as np

_a, _b = (6 + 15**0.5) / 21, (6 - 15**0.5) / 21
_u, _v = (155 + 15**0.5) / 2400, (155 - 15**0.5) / 2400
# Gauss points as area coordinates (L2, L3) and weights that add up to 1/2 (Zienkiewicz & Taylor 1989); section 3.4
RULES = {
    7: [(1 / 3, 1 / 3, 9 / 80), (_a, _a, _u), (1 - 2 * _a, _a, _u), (_a, 1 - 2 * _a, _u),
        (_b, _b, _v), (1 - 2 * _b, _b, _v), (_b, 1 - 2 * _b, _v)],
    4: [(1 / 3, 1 / 3, -27 / 96), (0.6, 0.2, 25 / 96), (0.2, 0.6, 25 / 96), (0.2, 0.2, 25 / 96)],
    3: [(1 / 6, 1 / 6, 1 / 6), (2 / 3, 1 / 6, 1 / 6), (1 / 6, 2 / 3, 1 / 6)],    # the interior points of section 6.4
}
EDGE_RULE = [(0.5 - 0.15**0.5, 5 / 18), (0.5, 4 / 9), (0.5 + 0.15**0.5, 5 / 18)]    # for (3.3.6), (3.3.7)


class Mooney:
    """Stresses (4.2) and their derivatives: C10 belongs to I1, C01 to I2."""

    def __init__(self, c10, c01):
        self.c10, self.c01 = c10, c01

    def stress(self, g):
        g11, g22, g12, g33 = g
        a, b = 2 * self.c10, 4 * self.c01
        S = np.array([a + b * (1 + g22 + g33), a + b * (1 + g33 + g11), -b * g12, a + b * (1 + g11 + g22)])
        D = b * np.array([[0, 1, 0, 1], [1, 0, 0, 1], [0, 0, -1, 0], [1, 1, 0, 0]])
        return S, D[:, :, None] * np.ones_like(g11)


class Ogden:
    """Stresses (4.4) and their derivatives. S12 has the factor +1/2 where (4.4) prints -1, a misprint."""

    def __init__(self, mu, alpha):
        self.terms = list(zip(mu, alpha, strict=True))

    def stress(self, g):
        g11, g22, g12, g33 = g
        m, e, t = 1 + g11 + g22, g11 - g22, 2 * g12                 # (2.2.29): lambda^2 = m +- phi1
        phi1 = np.hypot(e, t)
        apart = phi1 > 1e-7                                         # else equal stretches: the limit
        phi = np.where(apart, phi1, 1.0)
        dm, de, dt = (np.array(d)[:, None] for d in ([1, 1, 0, 0], [1, -1, 0, 0], [0, 0, 2, 0]))
        dphi = np.where(apart, (e * de + t * dt) / phi, 0)
        S, D = np.zeros((4, *m.shape)), np.zeros((4, 4, *m.shape))
        for mu, alpha in self.terms:
            a = (alpha - 2) / 2
            # mu lambda^(alpha - 2) and its slope, x = lambda^2
            (f1, s1), (f2, s2), (f3, s3) = (
                (mu * x**a, mu * a * x ** (a - 1)) for x in (m + phi1, m - phi1, 1 + 2 * g33))
            G = np.where(apart, (f1 - f2) / (2 * phi), s1)
            dG = np.where(apart, (s1 - s2) / (2 * phi), mu * a * (a - 1) * m ** (a - 2)) * dm
            dG = dG + ((s1 + s2) / 2 - G) / phi * dphi
            mean, dmean = (f1 + f2) / 2, (s1 + s2) / 2 * dm + (s1 - s2) / 2 * dphi
            S += np.array([mean + G * e, mean - G * e, G * t, f3])
            D[:3] += np.array([dmean + e * dG + G * de, dmean - e * dG - G * de, t * dG + G * dt])
            D[3, 3] += 2 * s3
        return S, D


class Penalty:
    """Stresses (3.4.4) of (1/eps) (I3 - 1)^2, and their derivatives."""

    def __init__(self, eps):
        self.eps = eps

    def stress(self, g):
        A, B, T, h = 1 + 2 * g[0], 1 + 2 * g[1], 1 + 2 * g[3], g[2]
        psi = A * B - 4 * h**2
        chi = 4 / self.eps * (psi * T - 1)                          # (3.4.5)
        q = np.array([B * T, A * T, -2 * T * h, psi])
        dI3 = 2 * np.array([B * T, A * T, -4 * h * T, psi])
        o = np.zeros_like(A)
        dq = 2 * np.array([[o, T, o, B], [T, o, o, A], [o, o, -T, -2 * h], [B, A, -4 * h, o]])
        return chi * q, 4 / self.eps * q[:, None] * dI3 + chi * dq


def shape(L2, L3):
    """The six shape functions and their derivatives by L2 and L3, shapes (6,), (2, 6)."""
    L1 = 1 - L2 - L3
    psi = np.array([L1 * (2 * L1 - 1), L2 * (2 * L2 - 1), L3 * (2 * L3 - 1), 4 * L1 * L2, 4 * L2 * L3, 4 * L3 * L1])
    by = np.array([[1 - 4 * L1, 4 * L2 - 1, 0, 4 * (L1 - L2), 4 * L3, -4 * L3],
                   [1 - 4 * L1, 0, 4 * L3 - 1, -4 * L2, 4 * L2, 4 * (L1 - L3)]])
    return psi, by


def body(X, u, law, points):
    """Nodal forces (3.1.13) and stiffness (3.4.8) of m elements, shapes (m, 12), (m, 12, 12); X, u: (m, 6, 2)."""
    n = len(X)
    f, K = np.zeros((n, 12)), np.zeros((n, 12, 12))
    r, z = slice(0, 12, 2), slice(1, 12, 2)
    twice = np.array([1, 1, 2, 1])                                  # 12 and 21
    for L2, L3, weight in RULES[points]:
        psi, by = shape(L2, L3)
        jacobian = by @ X
        pR, pZ = np.moveaxis(np.linalg.solve(jacobian, np.broadcast_to(by, (n, 2, 6))), 0, -1)   # by R and Z: (6, m)
        R, ur = X[:, :, 0] @ psi, u[:, :, 0] @ psi
        (urR, uzR), (urZ, uzZ) = (np.einsum("km,mkv->vm", p, u) for p in (pR, pZ))
        hoop = 1 + ur / R
        g = np.array([urR + (urR**2 + uzR**2) / 2, uzZ + (urZ**2 + uzZ**2) / 2,         # strains (2.2.28)
                      (urZ + uzR + urR * urZ + uzR * uzZ) / 2, (hoop**2 - 1) / 2])
        B = np.zeros((4, 12, n))                                    # their first derivatives
        B[0, r], B[0, z] = (1 + urR) * pR, uzR * pR
        B[1, r], B[1, z] = urZ * pZ, (1 + uzZ) * pZ
        B[2, r], B[2, z] = ((1 + urR) * pZ + urZ * pR) / 2, ((1 + uzZ) * pR + uzR * pZ) / 2
        B[3, r] = psi[:, None] * hoop / R
        S, D = law.stress(g)
        dV = 2 * np.pi * R * np.linalg.det(jacobian) * weight
        f += np.einsum("i,ikm,im,m->mk", twice, B, S, dV)
        DB = np.einsum("i,ijm,jlm,m->ilm", twice, D, B, dV)
        K += np.einsum("ikm,ilm->mkl", B, DB)
        RR, ZZ, RZ = (np.einsum("km,lm,m->mkl", a, b, c * dV) for a, b, c in
                      ((pR, pR, S[0]), (pZ, pZ, S[1]), (pR, pZ, S[2])))
        second = RR + ZZ + RZ + RZ.transpose(0, 2, 1)
        K[:, r, r] += second + (S[3] * dV / R**2)[:, None, None] * np.outer(psi, psi)
        K[:, z, z] += second
    return f, K


def load(x):
    """Nodal forces (3.3.6) and their derivatives (3.3.7) of a unit pressure on one edge, shapes (6,), (6, 6).

    x: deformed (r, z) of its first, middle and last node, shape (3, 2), the body on the left.
    """
    p, K = np.zeros(6), np.zeros((6, 6))
    r, z = slice(0, 6, 2), slice(1, 6, 2)
    for s, weight in EDGE_RULE:
        psi = np.array([1 - 3 * s + 2 * s**2, 4 * s - 4 * s**2, 2 * s**2 - s])          # (3.3.8)
        by = np.array([4 * s - 3, 4 - 8 * s, 4 * s - 1])
        radius, slope = psi @ x[:, 0], by @ x
        c = 2 * np.pi * weight
        p[r] -= c * radius * psi * slope[1]
        p[z] += c * radius * psi * slope[0]
        K[r, r] -= c * slope[1] * np.outer(psi, psi)
        K[r, z] -= c * radius * np.outer(psi, by)
        K[z, r] += c * (slope[0] * np.outer(psi, psi) + radius * np.outer(psi, by))
    return p, K
