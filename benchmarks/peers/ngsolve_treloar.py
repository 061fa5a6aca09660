"""Treloar's sheet with NGSolve: python3 ngsolve_treloar.py ELEMENTS LAYERS

P2/P1 (Taylor-Hood) on the triangles of formingx; forms compiled and differentiated by NGSolve as in its tutorial on
nonlinear elasticity; the hinge by two `NumberSpace` multipliers; pardiso. Arc length by hand, as formingx does it: a
plane normal to the tangent, steps that aim at four iterations, the same criterion of convergence.
"""

from clock import Clock, maximum, report, sizes
from ngsolve import (
    H1,
    BilinearForm,
    GridFunction,
    InnerProduct,
    LinearForm,
    NumberSpace,
    Parameter,
    Variation,
    VectorH1,
    ds,
    dx,
    x,
)
from ngsolve_sheet import energy, load, triangles
from treloar import C10, HEIGHT, RADIUS, THICKNESS

clock = Clock()
mesh = triangles(sizes(), RADIUS, THICKNESS)
fes = VectorH1(mesh, order=2, dirichletx="left") * H1(mesh, order=1) * NumberSpace(mesh) * NumberSpace(mesh)
(u, p, hold_r, hold_z), (v, q, test_r, test_z) = fes.TnT()
hinge = (hold_r * v[0] + hold_z * v[1] + test_r * u[0] + test_z * u[1]) * x
pressure = Parameter(0)
form = BilinearForm(fes)
form += Variation(energy(u, p, C10).Compile() * dx)
form += hinge.Compile() * ds("right")
form += (-pressure * load(u, v)).Compile() * ds("bottom")
push = BilinearForm(fes)
push += load(u, v).Compile() * ds("bottom")
metric = BilinearForm(InnerProduct(u, v) * x * dx).Assemble().mat
pole = LinearForm(fes)
pole += v[1](0, THICKNESS / 2)
pole.Assemble()

state = GridFunction(fes).vec
residual, unit = state.CreateVector(), state.CreateVector()
WEIGHT = 0.1 * RADIUS**4 * THICKNESS / (2 * C10) ** 2           # of the squared pressure in arc length
iterations = 0


def inner(a, b):
    """Return the inner product of two displacement fields, over the reference volume."""
    return InnerProduct(a, (metric * b).Evaluate())


def norm(a, pressure):
    return (inner(a, a) + WEIGHT * pressure**2) ** 0.5


def linearise(now):
    """Factorise the tangent at (state, pressure now); return the change of the state with the pressure."""
    global iterations
    iterations += 1
    pressure.Set(now)
    form.AssembleLinearization(state)
    push.Apply(state, unit)
    inverse.Update()
    return (inverse * unit).Evaluate()


def correct(now, gradient, slope, value):
    """Solve for equilibrium with gradient . state + slope * pressure = value, by Newton's method.

    Returns the pressure, the change of the state with the pressure, and the number of iterations.
    """
    last = 1.0
    for k in range(1, 13):
        by_pressure = linearise(now)
        form.Apply(state, residual)
        a = (-inverse * residual).Evaluate()
        missing = value - InnerProduct(gradient, state) - slope * now - InnerProduct(gradient, a)
        step = missing / (InnerProduct(gradient, by_pressure) + slope)
        a.data += step * by_pressure
        state.data += a
        now += step
        size = norm(a, step) / norm(state, now)
        if k > 1 and size * min(1, size / last) ** 2 < 1e-10:      # what the next correction would be
            return now, by_pressure, k
        if not size < 10:
            break
        last = size
    raise ArithmeticError("no convergence")


form.AssembleLinearization(state)
inverse = form.mat.Inverse(fes.FreeDofs(), inverse="pardiso")       # its analysis, once
by_pressure = linearise(0.0)
setup = clock.lap()

now, length, sense, iterations = 0.0, 0.02, 1.0, 0
heights, pressures, slopes = [0.0], [0.0], []
while heights[-1] < HEIGHT:
    size = sense * norm(by_pressure, 1.0)
    along_state, along_pressure = ((1 / size) * by_pressure).Evaluate(), 1 / size
    slopes.append(along_pressure / InnerProduct(pole.vec, along_state))
    before, start = state.CreateVector(), now
    before.data = state
    while True:
        rise = length * InnerProduct(pole.vec, along_state)
        last = heights[-1] + rise >= HEIGHT
        if last:
            length *= (HEIGHT - heights[-1]) / rise
        state.data = before + length * along_state
        try:
            if last:
                now, by_pressure, k = correct(start + length * along_pressure, pole.vec, 0.0, HEIGHT)
            else:
                plane = (metric * along_state).Evaluate()
                value = InnerProduct(plane, state) + WEIGHT * along_pressure * (start + length * along_pressure)
                now, by_pressure, k = correct(start + length * along_pressure, plane, WEIGHT * along_pressure, value)
            break
        except ArithmeticError:
            length /= 2
    sense = 1.0 if inner(by_pressure, along_state) + WEIGHT * along_pressure > 0 else -1.0
    heights.append(HEIGHT if last else InnerProduct(pole.vec, state))
    pressures.append(now)
    length *= min(2.0, 4 / k)
slopes.append(1 / InnerProduct(pole.vec, by_pressure))
report(setup, clock.lap(), unknowns=sum(fes.FreeDofs()), states=len(heights) - 1, iterations=iterations,
       limit=maximum(heights, pressures, slopes), pressure=now)
