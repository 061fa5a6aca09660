"""An axisymmetric sheet with NGSolve, for its scripts."""

from ngsolve import Det, Grad, Id, InnerProduct, log, x
from ngsolve.meshes import MakeStructured2DMesh


def triangles(elements, radius, thickness):
    """Return the triangles of formingx: elements along the radius and through the thickness."""
    n, m = elements
    return MakeStructured2DMesh(quads=False, nx=n, ny=m, mapping=lambda s, t: (radius * s, thickness * t))


def energy(u, p, c10, c01=0.0):
    """Return the energy density times R of an incompressible Mooney body with displacement u and pressure p."""
    F, hoop = Id(2) + Grad(u), 1 + u[0] / x
    J, in_plane = Det(F) * hoop, InnerProduct(F, F)
    W = c10 * (in_plane + hoop**2 - 3) - 2 * (c10 + 2 * c01) * log(J) + p * (J - 1)
    if c01:
        W += c01 * (Det(F) ** 2 + hoop**2 * in_plane - 3)
    return W * x


def load(u, v):
    """Return the work of a unit follower pressure on the bottom: n da = r (-dz/dR, dr/dR) dR."""
    along = Grad(u).Trace()
    return (x + u[0]) * (-along[1, 0] * v[0] + (1 + along[0, 0]) * v[1])


class Steps:
    """Load steps with a guess along the last two states, half the step on failure, longer ones after success.

    Args:
        form: form of the residual.
        state: `GridFunction` of displacement and pressure.
        inverse: pardiso's inverse of its free unknowns.
    """

    def __init__(self, form, state, inverse):
        self.form, self.state, self.inverse = form, state, inverse
        self.iterations = self.failures = 0
        self.accepted = [(0.0, state.vec.CreateVector(copy=True))]

    def follow(self, target, step, put):
        """Follow the path from 0 to a target; put(value, increment) sets the load before the guess."""
        now = 0.0
        while now < target:
            ahead = min(now + step, target)
            self.state.vec.data = self.accepted[-1][1]
            put(ahead, ahead - now)
            if len(self.accepted) > 1:
                (before, older), (now, newer) = self.accepted[-2:]
                self.state.vec.data = newer + (ahead - now) / (now - before) * (newer - older)
            k = self._correct()
            if k is None:
                self.failures += 1
                step /= 2
                if step < 1e-6:
                    raise SystemExit(f"no state beyond {now}")
                continue
            now = ahead
            self.accepted.append((now, self.state.vec.CreateVector(copy=True)))
            step *= min(2.0, 8 / k)

    def _correct(self):
        """Return the number of iterations of Newton's method, or None if it fails."""
        last, n = 1.0, self.state.space.components[0].ndof
        for k in range(1, 21):
            residual = self.form.Apply(self.state.vec)
            self.form.AssembleLinearization(self.state.vec)
            self.inverse.Update()
            step = (self.inverse * residual).Evaluate()
            self.state.vec.data -= step
            self.iterations += 1
            size = step[:n].Norm() / (self.state.vec[:n].Norm() + 1e-30)
            if k > 1 and size * min(1, size / last) ** 2 < 1e-10:
                return k
            if not size < 10:
                return None
            last = size
        return None
