"""The frictionless cup with NGSolve: python3 ngsolve_cup.py ELEMENTS LAYERS

P2/P1 (Taylor-Hood) on the triangles of formingx; the tool as a penalty energy of the distance, written as a formula;
pardiso. Pressure steps by hand: a guess along the last two states, half the step on failure, longer ones after success.
"""

from clock import Clock, report, sizes
from cup import C01, C10, DEPTH, FILLET, PENALTY, PRESSURE, RADIUS, THICKNESS
from ngsolve import H1, BilinearForm, GridFunction, IfPos, Parameter, Variation, VectorH1, ds, dx, sqrt, x, y
from ngsolve_sheet import energy, load, triangles

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

iterations = failures = 0


def correct():
    """Newton's method at the pressure that is set; the number of iterations, or None."""
    global iterations
    last = size = 1.0
    for k in range(1, 21):
        residual = form.Apply(state.vec)
        form.AssembleLinearization(state.vec)
        inverse.Update()
        step = (inverse * residual).Evaluate()
        state.vec.data -= step
        iterations += 1
        size = step[:fes.components[0].ndof].Norm() / (state.vec[:fes.components[0].ndof].Norm() + 1e-30)
        if k > 1 and size * min(1, size / last) ** 2 < 1e-10:
            return k
        if not size < 10:
            return None
        last = size
    return None


now, step, accepted = 0.0, 0.02, [(0.0, state.vec.CreateVector(copy=True))]
while now < PRESSURE:
    ahead = min(now + step, PRESSURE)
    pressure.Set(ahead)
    state.vec.data = accepted[-1][1]
    if len(accepted) > 1:
        (before, older), (now, newer) = accepted[-2:]
        state.vec.data += (ahead - now) / (now - before) * (newer - older)
    k = correct()
    if k is None:
        failures += 1
        step /= 2
        if step < 1e-6:
            raise SystemExit(f"no state beyond {now} psi")
        continue
    now = ahead
    accepted.append((now, state.vec.CreateVector(copy=True)))
    step *= min(2.0, 8 / k)
bottom, top = (state.components[0](mesh(0, z))[1] for z in (0, THICKNESS))
report(setup, clock.lap(), unknowns=sum(fes.FreeDofs()), states=len(accepted) - 1, iterations=iterations,
       thickness=1 + (top - bottom) / THICKNESS, failures=failures)
