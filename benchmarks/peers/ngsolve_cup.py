"""The frictionless cup with NGSolve: python3 ngsolve_cup.py ELEMENTS LAYERS

P2/P1 (Taylor-Hood) on the triangles of formingx; the tool as a penalty energy of the distance, written as a formula;
pardiso. Pressure steps by hand.
"""

from clock import Clock, report, sizes
from cup import C01, C10, DEPTH, FILLET, PENALTY, PRESSURE, RADIUS, THICKNESS
from ngsolve import H1, BilinearForm, GridFunction, IfPos, Parameter, Variation, VectorH1, ds, dx, sqrt, x, y
from ngsolve_sheet import Steps, energy, load, triangles

clock = Clock()
mesh = triangles(sizes(), RADIUS, THICKNESS)
fes = VectorH1(mesh, order=2, dirichletx="left|right", dirichlety="right") * H1(mesh, order=1)
(u, p), (v, q) = fes.TnT()
to_wall, to_floor = RADIUS - (x + u[0]), THICKNESS + DEPTH - (y + u[1])
round_the_edge = FILLET - sqrt((FILLET - to_wall) ** 2 + (FILLET - to_floor) ** 2 + 1e-30)
flat = IfPos(to_wall - to_floor, to_floor, to_wall)
gap = IfPos(FILLET - to_wall, IfPos(FILLET - to_floor, round_the_edge, flat), flat)
pressure = Parameter(0)
form = BilinearForm(fes)
form += Variation(energy(u, p, C10, C01).Compile() * dx)
form += Variation((PENALTY / 2 * IfPos(gap, 0, gap**2) * x).Compile() * ds("top"))
form += (-pressure * load(u, v)).Compile() * ds("bottom")
state = GridFunction(fes)
form.AssembleLinearization(state.vec)
inverse = form.mat.Inverse(fes.FreeDofs(), inverse="pardiso")       # its analysis, once
setup = clock.lap()

steps = Steps(form, state, inverse)
steps.follow(PRESSURE, 0.02, lambda psi, _: pressure.Set(psi))
bottom, top = (state.components[0](mesh(0, z))[1] for z in (0, THICKNESS))
report(setup, clock.lap(), unknowns=sum(fes.FreeDofs()), states=len(steps.accepted) - 1, iterations=steps.iterations,
       thickness=1 + (top - bottom) / THICKNESS, failures=steps.failures)
