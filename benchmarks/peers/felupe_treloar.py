"""Treloar's sheet with FElupe and contique: python3 felupe_treloar.py ELEMENTS LAYERS

Biquadratic quadrilaterals of nearly incompressible material; the path by contique as in FElupe's example of a balloon,
with PyPardiso, which FElupe's documentation advises; the hinge by two multipliers more. FElupe's axis is x. Three
fields: the body that keeps pressure and volume to itself (`SolidBodyNearlyIncompressible`) does not recover from a
step that fails.
"""

import contique
import felupe as fem
import numpy as np
from clock import Clock, maximum, report, sizes
from contique.helpers import argparser2
from contique.newtonxt import newtonxt
from felupe_disc import quadrilaterals
from pypardiso import spsolve
from scipy.sparse import bmat, csr_matrix, diags
from treloar import C10, HEIGHT, RADIUS, THICKNESS

clock = Clock()
n, m = sizes()
mesh = quadrilaterals((n, m), RADIUS, THICKNESS)
region = fem.RegionBiQuadraticQuad(mesh)
field = fem.FieldsMixed(region, n=3, axisymmetric=True)                 # displacement, pressure, volume ratio
solid = fem.SolidBody(fem.NearlyIncompressible(fem.NeoHooke(mu=2 * C10), bulk=2e6), field)
bottom = fem.RegionBiQuadraticQuadBoundary(mesh, only_surface=True, mask=mesh.points[:, 0] == 0, ensure_3d=True)
load = fem.SolidBodyPressure(fem.FieldContainer([fem.FieldAxisymmetric(bottom, dim=2)]))
bounds = {"axis": fem.Boundary(field[0], fy=0, skip=(True, False))}
held, free = fem.dof.partition(field, bounds)

rim = np.flatnonzero(mesh.points[:, 1] == RADIUS)
order = rim[np.argsort(mesh.points[rim, 0])]
weights = np.zeros(len(mesh.points))
for k in range(0, len(order) - 1, 2):                                  # Simpson's rule is exact for the mean
    weights[order[k:k + 3]] += np.array([1, 4, 1]) / (6 * m)
C = np.zeros((2, len(free) + len(held)))
C[0, 0:2 * len(weights):2] = C[1, 1:2 * len(weights):2] = weights
C = csr_matrix(C[:, free])
scale = np.where(free < 2 * len(weights), 1.0, 1e3)                     # contique limits all changes alike
pole = np.argmin(np.linalg.norm(mesh.points - [THICKNESS / 2, 0], axis=1))
pole = int(np.flatnonzero(free == 2 * pole)[0])
iterations = 0


def put(x):
    """Put the free unknowns into FElupe's fields; return the two multipliers."""
    values = np.zeros(len(free) + len(held))
    values[free] = x[:-2] * scale
    for part, start in zip(field.fields, [0, *np.cumsum(field.fieldsizes)]):
        part.values[:] = values[start:start + part.values.size].reshape(part.values.shape)
    field[2].values += 1
    return x[-2:] * 1e3


def forces(x, pressure, *_):
    """Return internal less external forces, and the mean displacements of the rim."""
    multipliers = put(x)
    load.update(pressure)
    return np.append(fem.tools.fun([solid, load], field)[free] + C.T @ multipliers, C @ x[:-2])


def by_state(x, pressure, *_):
    """Return the derivative of `forces` by the state."""
    global iterations
    iterations += 1
    put(x)
    load.update(pressure)
    K = fem.tools.jac([solid, load], field)[free][:, free]
    return bmat([[K @ diags(scale), 1e3 * C.T], [C, None]], format="csr")


def by_pressure(x, pressure, *_):
    """Return the derivative of `forces` by the pressure."""
    put(x)
    load.update(1.0)
    return np.append(fem.tools.fun([load], field)[free], [0.0, 0.0])


setup = clock.lap()
jacobian = [by_state, by_pressure]
heights, pressures = [], []
for found in contique.solve(fun=forces, jac=jacobian, x0=np.zeros(len(free) + 2), lpf0=0.0, control0=(pole, 1),
                            dxmax=0.05, dlpfmax=0.05, maxsteps=500, tol=1e-8, rebalance=True, high=2, solve=spsolve):
    heights.append(found.x[pole])
    pressures.append(found.x[-1])
    if heights[-1] > HEIGHT:
        break
back = np.full(len(found.x), heights[-1] - HEIGHT)                      # to the height itself
found = newtonxt(argparser2(forces), jacobian, found.x, (pole, -1), back, tol=1e-8, solve=spsolve)
report(setup, clock.lap(), unknowns=len(free) + 2, states=len(heights), iterations=iterations,
       limit=maximum(heights, pressures, np.gradient(pressures, heights)), pressure=found.x[-1])
