"""Newton's method at fixed control, by PETSc SNES, in load increments (Song 1993, section 3.2)."""

from __future__ import annotations

import itertools
import time
from typing import Any

import numpy as np
from petsc4py import PETSc

from ..discrete.problem import Problem
from ..errors import ConvergenceError, count, finite, instance
from ..results.path import Path
from ..scene.scene import Scene
from .curve import Branch
from .diagnose import Attempt, diagnose
from .direct import configure
from .newton import UNLOADED, Iteration, Tolerances
from .stepping import StepControl

_prefixes = itertools.count()


class FixedControl:
    """F(x, control) = 0 at a given control.

    Full Newton steps: on a thin sheet a backtracking line search stalls.
    """

    def __init__(self, problem: Any, tolerances: Tolerances):
        self._problem, self._tolerances = problem, tolerances
        self._control, self._work = 0.0, 0.0
        self.history: list[Iteration] = []
        self._snes = PETSc.SNES().create(problem.comm)
        self._snes.setType("newtonls")
        self._snes.setFunction(self._function, problem.x.duplicate())
        self._snes.setJacobian(self._jacobian, problem.matrix)
        self._snes.setConvergenceTest(self._test)
        self._snes.setTolerances(max_it=tolerances.iterations)
        configure(self._snes.getKSP(), problem.matrix, problem.symmetric)
        prefix, options = f"formingx_{next(_prefixes)}_", PETSc.Options()
        self._snes.setOptionsPrefix(prefix)
        options[prefix + "snes_linesearch_type"] = "basic"
        self._snes.setFromOptions()
        del options[prefix + "snes_linesearch_type"]

    def solve(self, x: PETSc.Vec, control: float) -> bool:
        """Iterate x, in place, to the solution; False if there was no convergence (x is then worthless)."""
        self._control, self._work, self.history = control, 0.0, []
        self._snes.solve(None, x)
        return self._snes.getConvergedReason() > 0

    def correction(self) -> np.ndarray:
        """The last correction of x, own part, shape (n,)."""
        return -self._snes.getSolutionUpdate().array_r

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        self._snes.destroy()

    def _function(self, snes: Any, x: PETSc.Vec, out: PETSc.Vec) -> None:
        self._problem.residual(x, self._control, out)

    def _jacobian(self, snes: Any, x: PETSc.Vec, A: PETSc.Mat, P: PETSc.Mat) -> None:
        self._problem.tangent(x, self._control)

    def _test(self, snes: Any, iteration: int, norms: tuple) -> int:
        size, step, residual = norms
        relative = residual / (self._problem.force_scale + UNLOADED)
        correction = step / (size + 1e-8) if iteration else 1.0
        work = abs(snes.getFunction()[0].dot(snes.getSolutionUpdate())) if iteration else 0.0
        self._work = self._work or work
        self.history.append(Iteration(relative, correction, work / self._work if self._work else 1.0))
        if not np.isfinite(relative):
            return PETSc.SNES.ConvergedReason.DIVERGED_FNORM_NAN
        if self._tolerances.met([i.correction for i in self.history[1:]], [i.residual for i in self.history]):
            return PETSc.SNES.ConvergedReason.CONVERGED_SNORM_RELATIVE
        return PETSc.SNES.ConvergedReason.ITERATING


def solve(scene: Scene, *, to: float, increments: int = 1, tolerances: Tolerances | None = None) -> Path:
    """Load the body to a value of the control in increments, each by Newton's method at fixed control.

    For scenes without limit point before `to`; `trace` passes limit points and picks its own steps.

    Args:
        to: pressure (stress) or travel (length) of what is driven.
        increments: number of equal increments; one that fails is halved.
        tolerances: when a state counts as converged; default `Tolerances()`.

    Raises:
        InputError: nothing is driven, or an argument is not allowed.
        ConvergenceError: an increment did not converge; it carries the path so far.
    """
    instance("solve: scene", scene, Scene, "a formingx.Scene")
    instance("solve: tolerances", tolerances, Tolerances | None, "a Tolerances or None")
    scene.only_driven("solve")
    to, increments = finite("solve: to", to), count("solve: increments", increments)
    problem, began = Problem(scene), time.perf_counter()
    tolerances = tolerances or Tolerances()
    branch, newton = Branch(problem, tolerances), FixedControl(problem, tolerances)
    path, x = Path(problem, branch), problem.x.duplicate()
    path.record(branch.start())
    step = StepControl(length=1 / increments, largest=1 / increments, smallest=1e-5 / increments)
    done = 0.0                                               # fraction of `to`
    while done < 1:
        old, fraction = path.last, min(done + step.length, 1.0)
        if 1 - fraction < 1e-9:
            fraction = 1.0
        control = fraction * to / problem.forms.control_scale
        lead = (control - old.control) / old.slope           # along the tangent, as far as the control asks
        problem.prepare(old.x, old.control, old.direction, old.slope, lead)
        x.array_w[:] = branch.guess_from_rest(old, control) if old.kind == "start" else old.x + lead * old.direction
        converged = newton.solve(x, control) and not problem.folded(x, control)
        path.counts.iterations += len(newton.history) - 1
        if converged:
            path.record(branch.adopt(x, control, newton.history, old))
            step.accepted(len(newton.history) - 1)
            done = fraction
            continue
        path.counts.failures += 1
        if not step.failed():
            attempt = Attempt(x.array_r.copy(), control, newton.correction(), 0.0)
            found = diagnose(branch, path.states, "Newton's method at fixed control did not converge", attempt,
                             fixed_control=True)
            raise ConvergenceError(
                f"no equilibrium was found beyond {path.describe(old)} by Newton's method at fixed control, however"
                f" small the increment: the path may turn back there. That state is the last good one; it is kept in"
                f" the error's `path`. Try `trace`, which passes limit points.", path, found)
    path.counts.seconds = time.perf_counter() - began
    newton.destroy()
    return path
