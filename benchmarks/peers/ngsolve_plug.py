"""A plug of driven nodes with NGSolve: python3 ngsolve_plug.py ELEMENTS LAYERS

P2/P1 (Taylor-Hood) on the triangles of formingx; pardiso. Steps by hand.
"""

from math import pi

from clock import Clock, report, sizes
from ngsolve import H1, BilinearForm, GridFunction, Variation, VectorH1, dx
from ngsolve_sheet import Steps, energy, triangles
from plug import C10, PLUG, RADIUS, THICKNESS, TRAVEL

clock = Clock()
mesh = triangles(sizes(), RADIUS, THICKNESS)
fes = VectorH1(mesh, order=2, dirichletx="left|right", dirichlety="right") * H1(mesh, order=1)
(u, p), (v, q) = fes.TnT()
form = BilinearForm(fes)
form += Variation(energy(u, p, C10).Compile() * dx)
state, up = GridFunction(fes), GridFunction(fes)
free, plug = fes.FreeDofs(), set()
space = fes.components[0].components[1]                             # of u_z, whose dofs are the second half of u's
for element in mesh.Boundaries("bottom").Elements():
    if all(mesh[corner].point[0] <= PLUG + 1e-9 for corner in element.vertices):
        plug |= set(space.GetDofNrs(element))
        for corner in element.vertices:                             # dofs of edges are 0 where u_z is constant
            up.components[0].components[1].vec[corner.nr] = 1
for dof in plug:
    free[dof] = free[space.ndof + dof] = False
form.AssembleLinearization(state.vec)
inverse = form.mat.Inverse(free, inverse="pardiso")                 # its analysis, once
setup = clock.lap()


def lift(_, rise):
    """Move the plug up."""
    state.vec.data += rise * up.vec


steps = Steps(form, state, inverse)
steps.follow(TRAVEL, 1.0, lift)
force = 2 * pi * form.Apply(state.vec).InnerProduct(up.vec)
report(setup, clock.lap(), unknowns=sum(free), states=len(steps.accepted) - 1, iterations=steps.iterations,
       force=abs(force), failures=steps.failures)
