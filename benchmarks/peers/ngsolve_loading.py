"""A disc under pressure with NGSolve: python3 ngsolve_loading.py ELEMENTS LAYERS

P2/P1 (Taylor-Hood) on the triangles of formingx; compiled forms and NGSolve's own `Newton` with pardiso.
"""

import contextlib
import io

from clock import Clock, report, sizes
from loading import C10, PRESSURE, RADIUS, STEPS, THICKNESS
from ngsolve import H1, BilinearForm, GridFunction, Parameter, Variation, VectorH1, ds, dx
from ngsolve.solvers import Newton
from ngsolve_sheet import energy, load, triangles

clock = Clock()
mesh = triangles(sizes(), RADIUS, THICKNESS)
fes = VectorH1(mesh, order=2, dirichletx="left|right", dirichlety="right") * H1(mesh, order=1)
(u, p), (v, q) = fes.TnT()
pressure = Parameter(0)
form = BilinearForm(fes)
form += Variation(energy(u, p, C10).Compile() * dx)
form += (-pressure * load(u, v)).Compile() * ds("bottom")
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
