"""A disc under pressure with NGSolve: python3 ngsolve_loading.py ELEMENTS LAYERS

P2/P1 (Taylor-Hood) on the triangles of formingx; compiled forms and NGSolve's own `Newton` with pardiso.
"""

import contextlib
import io

from clock import Clock, report, sizes
from loading import C10, PRESSURE, RADIUS, STEPS, THICKNESS
from ngsolve import (
    H1,
    BilinearForm,
    Det,
    Grad,
    GridFunction,
    Id,
    InnerProduct,
    Parameter,
    Variation,
    VectorH1,
    ds,
    dx,
    log,
    x,
)
from ngsolve.meshes import MakeStructured2DMesh
from ngsolve.solvers import Newton

clock = Clock()
n, m = sizes()
mesh = MakeStructured2DMesh(quads=False, nx=n, ny=m, mapping=lambda s, t: (RADIUS * s, THICKNESS * t))
fes = VectorH1(mesh, order=2, dirichletx="left|right", dirichlety="right") * H1(mesh, order=1)
(u, p), (v, q) = fes.TnT()
F, hoop, along = Id(2) + Grad(u), 1 + u[0] / x, Grad(u).Trace()
J = Det(F) * hoop
energy = (C10 * (InnerProduct(F, F) + hoop**2 - 3) - 2 * C10 * log(J) + p * (J - 1)) * x     # no stress at rest
load = (x + u[0]) * (-along[1, 0] * v[0] + (1 + along[0, 0]) * v[1])            # n da = r (-dz/dR, dr/dR) dR
pressure = Parameter(0)
form = BilinearForm(fes)
form += Variation(energy.Compile() * dx)
form += (-pressure * load).Compile() * ds("bottom")
state = GridFunction(fes)
setup = clock.lap()

iterations = 0
for k in range(STEPS):
    pressure.Set(PRESSURE * (k + 1) / STEPS)
    with contextlib.redirect_stdout(io.StringIO()):
        _, done = Newton(form, state, inverse="pardiso", maxerr=1e-10)
    iterations += done
report(setup, clock.lap(), unknowns=sum(fes.FreeDofs()), states=STEPS, iterations=iterations,
       rise=state.components[0](mesh(0, 0))[1])
