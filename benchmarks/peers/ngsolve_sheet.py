"""A sheet with NGSolve, axisymmetric: what the scripts for NGSolve share."""

from ngsolve import Det, Grad, Id, InnerProduct, log, x
from ngsolve.meshes import MakeStructured2DMesh


def triangles(elements, radius, thickness):
    """The triangles of formingx: elements along the radius and through the thickness."""
    n, m = elements
    return MakeStructured2DMesh(quads=False, nx=n, ny=m, mapping=lambda s, t: (radius * s, thickness * t))


def energy(u, p, c10, c01=0.0):
    """Incompressible Mooney, no stress at rest, times R: of displacement u and pressure p."""
    F, hoop = Id(2) + Grad(u), 1 + u[0] / x
    J, in_plane = Det(F) * hoop, InnerProduct(F, F)
    W = c10 * (in_plane + hoop**2 - 3) - 2 * (c10 + 2 * c01) * log(J) + p * (J - 1)
    if c01:
        W += c01 * (Det(F) ** 2 + hoop**2 * in_plane - 3)
    return W * x


def load(u, v):
    """Work of a unit pressure, which follows the bottom, on v: n da = r (-dz/dR, dr/dR) dR."""
    along = Grad(u).Trace()
    return (x + u[0]) * (-along[1, 0] * v[0] + (1 + along[0, 0]) * v[1])
