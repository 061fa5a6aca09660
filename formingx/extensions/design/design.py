"""Search for the parameters of a run that give an even, a wanted or a measured wall, or the minimum weight."""

from __future__ import annotations

import copy
import inspect
import logging
from collections.abc import Callable, Mapping, Sequence
from concurrent import futures
from typing import Any

import numpy as np

from ...errors import ConvergenceError, InputError, check_name, check_type, count, positive
from ...measures.targets import Target
from ...runs import Process, trace
from ...scene.scene import Scene
from ...solve.newton import Tolerances
from ...solve.stage import Stage
from ...solve.stepping import StepControl
from ...values.tolerances import NEGLIGIBLE
from .objective import SETTINGS, MeasuredWallObjective, WallObjective, mask_of_range, missed_target
from .parameters import Parameters
from .result import DesignResult
from .run import DesignRun
from .whole_runs import WholeRuns

log = logging.getLogger("formingx")

_MOST_WHOLE_RUNS = 60
"""Default of the largest number of runs of a search whose derivatives are differences of whole runs."""


class Design:
    """Design of a part: a scene that depends on parameters, its runs, and the search for the best parameters.

    Args:
        build: function that takes the parameters by name, and returns (scene, target) or (scene, stages) for `trace` or
            `Process.run`. It is also called with slightly changed parameters, for derivatives: then only the positions
            of the nodes of its mesh may differ, not their number. In the runs, one gap closes per step of a contact
            without `nodes_per_step`, so that the gap closures have exact derivatives.
        parameters: {name: start value, (start value, lower bound, upper bound), or `spline(...)`}. `build` receives a
            spline as a function of a length from 0 to 1.
        step: control of the step length of each run, as in `trace`.
        tolerances: tolerances of each run, as in `trace`.
        max_steps: maximum number of steps of each run, as in `trace`.
        derivatives: "exact" for derivatives by the tangents of the run, "runs" for differences of whole runs, each with
            one parameter changed by 2 % of its range. Default: "runs" with contact in three dimensions, which
            has no exact ones, and else "exact".
        workers: number of parallel processes for these differences; 1: one run after the other in this process. Other
            processes import `build`: no lambda, no function inside another.
        executor: executor of `concurrent.futures` for these differences; default: processes of this machine.

    Attributes:
        parameters: the `Parameters` of the design.
        paths: number of runs so far in this process.
        whole_runs: runs for differences; its `count` is their number.

    Raises:
        InputError: `build` is no function of these parameters, or a parameter has wrong values or bounds.

    >>> def build(thickness):
    ...     return fx.Scene(mesh=fx.mesh.disc(radius=10.0, thickness=thickness, elements=(8, 1)),
    ...                     materials=fx.NeoHookean(c10=0.4), loads=[fx.Pressure("bottom")],
    ...                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")]), fx.pole_height(4.0)
    >>> effects = fx.Design(build, {"thickness": (0.5, 0.1, 1.0)}).run().sensitivities("pressure")
    >>> effects.names, round(float(effects.jacobian[0, 0]), 3)
    (['thickness'], 0.046)
    """

    def __init__(self, build: Callable[..., Any], parameters: Mapping[str, Any], *, step: StepControl | None = None,
                 tolerances: Tolerances | None = None, max_steps: int | None = None, derivatives: str | None = None,
                 workers: int = 1, executor: futures.Executor | None = None):
        if not callable(build):
            raise InputError(f"Design: build = {build!r}: must be a function of the parameters that returns a scene and"
                             f" its target or stages")
        self._build, self.parameters = build, Parameters(parameters)
        try:
            inspect.signature(build).bind(**dict.fromkeys(parameters))
        except TypeError as error:
            raise InputError(f"Design: parameters {', '.join(map(repr, parameters))}: build{inspect.signature(build)}"
                             f" cannot be called with these: {error}") from None
        self._step, self._tolerances, self._max_steps = step, tolerances, max_steps
        if derivatives is not None:
            check_name("Design: derivatives", derivatives, ("exact", "runs"))
        self._derivatives = derivatives
        self.whole_runs: WholeRuns = WholeRuns(count("Design: workers", workers), executor)
        self.paths = 0                                       # number of runs so far

    def __getstate__(self) -> dict[str, Any]:
        """Return the design for another process, which makes no differences of its own."""
        return vars(self) | {"whole_runs": None}

    def run(self, values: Mapping[str, Any] | None = None) -> DesignRun:
        """Compute the run for given values of the parameters.

        Args:
            values: {parameter: value}; the other parameters have their start values.

        Returns:
            The run, which can compute its derivatives.

        Raises:
            InputError: `build` returns no (scene, target) or (scene, stages), or a scene that is not allowed.
            ConvergenceError: see `trace`.
        """
        return self._run(self.parameters.vector(values or {}))

    def _make(self, vector: np.ndarray) -> tuple[Any, Any]:
        """Return (scene, target or stages) of the user's function at parameters `vector`, shape (n,), checked."""
        made = self._build(**self.parameters.values(vector))
        if not isinstance(made, tuple) or len(made) != 2 or not isinstance(made[0], Scene):
            raise InputError("Design: build must return (scene, target) or (scene, stages)")
        scene, end = made
        if not isinstance(end, Target):
            end = list(end) if isinstance(end, Sequence) else end
            if not isinstance(end, list) or not end or not all(isinstance(stage, Stage) for stage in end):
                raise InputError(f"Design: build returns the end {made[1]!r}: must be a target, such as pressure(1), or"
                                 f" stages")
        return scene, end

    def _run(self, vector: np.ndarray) -> DesignRun:
        """Compute the run for values of the parameters, those of a profile at its knots, shape (n,)."""
        scene, end = self._make(vector)
        scene = copy.copy(scene)                             # the scene of the script does not change
        lagged = any(contact.lagged for contact in scene.contacts)
        scene.one_node_per_step = not lagged                 # exact derivatives of gap closures need it
        self.paths += 1
        options: dict[str, Any] = {"step": self._step, "tolerances": self._tolerances, "max_steps": self._max_steps,
                                   "progress": False}
        path = trace(scene, until=end, **options) if isinstance(end, Target) else Process(scene).run(end, **options)
        by_runs = self._derivatives == "runs" or self._derivatives is None and lagged
        return DesignRun(self._make, self.parameters, vector, path, end, self._tolerances, self if by_runs else None)

    def fit(self, *, wall: Any = None, even: bool = False, within: tuple[float, float] | None = None,
            volume: str | float | None = "kept", max_runs: int | None = None, min_change: float = 1e-4,
            start: Mapping[str, Any] | DesignRun | None = None) -> DesignResult:
        """Search for the parameters that give an even, a wanted or a measured wall thickness.

        A Gauss-Newton method with bounds proposes each step; a run checks it. The reference length of a node is its
        distance from the axis along the middle line of the undeformed body.

        Args:
            wall: wanted thickness, length: a number, or a function of the reference length. With a `MeasuredWall` the
                parameters are fitted to it (see `DesignResult.confidence`).
            even: True for the most even wall, with the lowest standard deviation over mean.
            within: lowest and highest reference length of the nodes that count, length; default all.
            volume: "kept": the reference volume of the first run is prescribed, but free with a measured wall.
                A number prescribes the reference volume, length^3; None leaves it free.
            max_runs: maximum number of runs; default 10, or 60 with those for differences of whole runs.
            min_change: the search ends if the predicted relative change of the wall (root mean square) is smaller.
            start: {parameter: start value}, or a run of this design.

        Returns:
            First and best run of the search, and the reason for its end.

        Raises:
            InputError: neither or both of `wall` and `even` are given, or no parameter has an effect on the wall.
            ConvergenceError: the first run fails.
        """
        if not check_type("fit: even", even, bool, "True or False") and wall is None:
            raise InputError("fit: nothing to fit: give it wall=..., a wanted thickness, or even=True")
        if even and wall is not None:
            raise InputError("fit: wall and even=True are both given: must be one of them")
        most = None if max_runs is None else count("fit: max_runs", max_runs)
        min_change = positive("fit: min_change", min_change)
        if isinstance(volume, str) and volume != "kept" or isinstance(volume, bool):
            raise InputError(f"fit: volume = {volume!r}: must be 'kept', a number or None")
        first = start if isinstance(start, DesignRun) else self._run(self.parameters.vector(start or {}))
        measured = hasattr(wall, "of_path")
        if measured and within is not None:
            raise InputError("fit: within is for a wanted wall: leave points of a measured one out of it")
        prescribed = None if volume is None or measured and volume == "kept" else (
            first.volume * (1 - SETTINGS.volume_margin) if volume == "kept" else positive("fit: volume", volume))
        objective = (MeasuredWallObjective(first, wall, prescribed) if measured
                     else WallObjective(first, wall, within, prescribed))
        most = most or (_MOST_WHOLE_RUNS if first.missing_runs else 10)
        return self._search(first, objective, most, min_change)

    def _search(self, first: DesignRun, objective: WallObjective, max_runs: int, min_change: float) -> DesignResult:
        """Search with Gauss-Newton steps from the best run, which are halved if a run is worse or fails.

        The search ends after `max_runs` runs, or if the predicted relative change of the wall is below `min_change`.
        """
        from scipy.optimize import lsq_linear
        low, high, size = self.parameters.low, self.parameters.high, self.parameters.size
        best, runs, predicted, gained_before = first, [first], first.wall, 1.0
        failed: list[str] = []
        before = self.whole_runs.count
        reason = f"max_runs = {max_runs} were used up"
        while self._runs_left(max_runs, runs, failed, before) > best.missing_runs:
            try:
                residual, jacobian = objective.residual(best)
            except InputError as error:
                if best is first:
                    raise
                reason = str(error)
                break
            if not np.any(np.abs(jacobian * size) > 1e-9):
                raise InputError("fit: no parameter has an effect on what is fitted")
            # the damping keeps parameters without effect at their values
            damping = objective.damping * np.linalg.norm(jacobian * size, 2) * np.eye(len(size))
            step = lsq_linear(np.vstack([jacobian * size, damping]), np.append(-residual, 0 * size), tol=1e-12,
                              bounds=((low - best.vector) / size, (high - best.vector) / size)).x * size
            change = np.sqrt(np.mean((jacobian @ step) ** 2))
            improvement = 1 - np.sum((residual + jacobian @ step) ** 2) / np.sum(residual**2)
            if change < min_change or improvement < SETTINGS.min_improvement:
                reason = f"the next step would change the wall by {change:.1e}" if change < min_change else (
                    f"the next step, within the bounds, would be {100 * max(improvement, 0.0):.1f} % better")
                break
            share, new = 1.0, None
            while share >= SETTINGS.shortest_step and self._runs_left(max_runs, runs, failed, before) > 0:
                try:
                    new = self._run(np.clip(best.vector + share * step, low, high))
                    runs.append(new)
                    if objective.cost(new) < objective.cost(best):
                        break
                except (InputError, ConvergenceError) as error:
                    failed.append(str(error).splitlines()[0])
                share, new = share / 2, None
            if new is None:
                reason = "no shorter step brings an improvement" if share < SETTINGS.shortest_step else reason
                break
            predicted = best.wall + share * (best.derivative("wall")[1] @ step)
            gained = 1 - objective.cost(new) / objective.cost(best)
            best.forget_perturbed_runs()
            best = new
            if max(gained, gained_before) < SETTINGS.min_improvement:    # a small improvement may precede a larger one
                reason = f"the last run was {100 * gained:.1f} % better"
                break
            gained_before = gained
            log.info("design: run %d, cost %.3g", len(runs), objective.cost(best))
        missed = [missed_target("volume", objective.volume, best.volume), objective.shortfall(best)]
        return DesignResult(first, best, runs, failed, objective.inside, reason, predicted,
                            "\n".join(filter(None, missed)), objective.target_wall, objective.measured,
                            *self.whole_runs.since(before))

    def _runs_left(self, most: int, runs: list[DesignRun], failed: list[str], before: int) -> int:
        """Return the number of runs that a search may still take; before: count of whole runs at its start."""
        return most - len(runs) - len(failed) - (self.whole_runs.count - before)

    def minimum_weight(self, min_wall: float, within: tuple[float, float] | None = None,
                       max_runs: int | None = None) -> DesignResult:
        """Search for the smallest reference volume whose wall thickness is nowhere below a minimum.

        Successive linear programs minimise the linearised volume within a trust region, which shrinks if a run is worse
        (Palacios-Gomez, Lasdon and Engquist 1982). The wall at every node is a separate linear constraint. So the
        method needs no derivative of the minimum wall, which is not differentiable where the thinnest node changes.

        Args:
            min_wall: minimum wall thickness, length.
            within: lowest and highest reference length (distance from the axis along the undeformed middle line) of
                the nodes that count, length; default all.
            max_runs: maximum number of runs; default 15, or 60 with those for differences of whole runs.

        Returns:
            First and best run of the search, and the reason for its end.

        Raises:
            InputError: a minimum wall or number of runs that is not positive, or the first run has no derivative.
            ConvergenceError: the first run fails.
        """
        from scipy.optimize import linprog
        min_wall = positive("minimum_weight: min_wall", min_wall)
        most = None if max_runs is None else count("minimum_weight: max_runs", max_runs)
        low, high, size = self.parameters.low, self.parameters.high, self.parameters.size
        first = self._run(self.parameters.start.copy())
        inside = mask_of_range(first, within)
        unit = min(min_wall, first.wall[inside].min())
        best, runs, predicted, trust_radius = first, [first], first.wall, 0.25
        failed: list[str] = []
        before = self.whole_runs.count
        most = most or (_MOST_WHOLE_RUNS if first.missing_runs else 15)
        reason = f"max_runs = {most} were used up"

        def cost(run: DesignRun) -> float:
            """Return the volume of a run over the first run's, plus a penalty for a wall below the minimum."""
            return run.volume / first.volume + 10 * max(min_wall - run.wall[inside].min(), 0.0) / unit
        while self._runs_left(most, runs, failed, before) > best.missing_runs:
            try:
                wall, jacobian = best.derivative("wall")
            except InputError as error:
                if best is first:
                    raise
                reason = str(error)
                break
            volume_slope = best.derivative("volume")[1][0] / first.volume
            n = len(size)
            # a slack variable for the missing wall makes the program feasible
            rows = np.column_stack([-jacobian[inside] * size, -np.full(inside.sum(), unit)])
            effects = np.vstack([jacobian[inside] / wall[inside].mean(), volume_slope]) * size
            bounds = [(max((a - v) / s, -trust_radius), min((b - v) / s, trust_radius)) if effect >= NEGLIGIBLE
                      else (0.0, 0.0)                           # the program would move it to any place
                      for a, b, v, s, effect in zip(low, high, best.vector, size, abs(effects).max(0))]
            found = linprog(np.append(volume_slope * size, 10.0), A_ub=rows, b_ub=wall[inside] - min_wall,
                            bounds=[*bounds, (0, None)])
            step = found.x[:n] * size
            gain = cost(best) - (best.volume / first.volume + found.fun)
            if gain < 1e-5:
                reason = f"the next step would save {max(gain, 0.0):.1e} of the volume"
                break
            try:
                new = self._run(np.clip(best.vector + step, low, high))
                runs.append(new)
                if cost(new) < cost(best):
                    best.forget_perturbed_runs()
                    predicted, best, trust_radius = wall + jacobian @ step, new, min(2 * trust_radius, 1.0)
                    continue
            except (InputError, ConvergenceError) as error:
                failed.append(str(error).splitlines()[0])
            trust_radius /= 4
            if trust_radius < 1e-4:
                reason = "no shorter step brings an improvement"
                break
        thinnest = best.wall[inside].min()
        return DesignResult(first, best, runs, failed, inside, reason, predicted,
                            missed_target("minimum wall", min_wall, min(thinnest, min_wall)),
                            None, None, *self.whole_runs.since(before))
