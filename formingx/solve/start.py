"""The first state of a path."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import ConvergenceError
from ..measures.targets import Amplitude, Target
from .arc_length import Curve
from .diagnose import diagnose
from .newton import Failure
from .path_following import Run
from .state import Record, State


def begin(curve: Curve) -> State:
    """The first state of a path: the body at control 0, in equilibrium with whatever else acts on it.

    Fixed loads for which Newton's method finds no equilibrium from rest are brought in gradually.

    Raises:
        ConvergenceError: there is none.
    """
    problem = curve.problem
    try:
        return curve.start()
    except Failure as failure:
        first, rest = problem.setting, np.zeros(problem.x.getLocalSize())
        if not problem.fixed_loads:
            raise _no_start(curve, failure) from None
        record = Record(problem, curve)
        target = Target("change", 1.0, None)
        try:
            problem.enter(replace(first, rate=[0.0] * len(first.rate), fading=True), rest, 0.0)
            run = Run(record, [(target, Amplitude(problem, None))])
            run.follow(1000, False, curve.resume(rest, 0.0))
        except (ConvergenceError, Failure):
            raise _no_start(curve, failure) from None
        problem.enter(first, record.last.x, 0.0)
        return curve.resume(record.last.x, 0.0)


def _no_start(curve: Curve, failure: Failure) -> ConvergenceError:
    """The error of a body for which no first state was found."""
    loads = curve.problem.fixed_loads
    words, advice = (f", under {', '.join(loads)}", "drive the largest of them instead") if loads else (
        "", "a tool touches the body at rest: give its Contact a smaller ramp")
    return ConvergenceError(f"no equilibrium was found before anything is driven{words}: {failure.reason}; {advice}",
                            diagnosis=diagnose(curve, [], failure.reason, failure.attempt))
