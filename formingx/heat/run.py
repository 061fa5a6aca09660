"""Heating and cooling over time: `heat`."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from mpi4py import MPI

from ..errors import ConvergenceError, InputError, finite, instance, known, positive, several
from ..mesh import Mesh
from ..physics.kinematics import Axisymmetric
from ..scene import fields
from ..time_temperature import ABSOLUTE_ZERO
from . import stepping
from .boundaries import FixedTemperature, ThermalProperties
from .conduction import Conduction
from .result import HeatRun

_log = logging.getLogger(__name__)


def heat(mesh: Mesh, materials: ThermalProperties | Mapping[str, ThermalProperties], boundaries: Sequence[Any] = (), *,
         start: Any, times: Any, unit: str, kinematics: Any = None, displacement: Any = None, tolerance: float = 1e-3,
         max_steps: int = 10000) -> HeatRun:
    """Conduction of heat in a body over time, from t = 0.

    Args:
        mesh: of the body, from `formingx.mesh`. A boundary without a law lets no heat through.
        materials: {layer: `ThermalProperties`}, or one for all layers.
        boundaries: a list of `Convection`, `Radiation`, `HeatFlux`, `FixedTemperature`, `ContactWithTool`,
            `Absorption`; several on one boundary add up.
        start: temperature at first: a number, a `table` over R, a function of arrays (R, Z), a CSV file with columns
            R, Z, T, an earlier `HeatRun` (its end), or a DOLFINx Function.
        times: when to look at it, times above 0 that grow, the last one the end; or the end alone. Steps end there.
        unit: of all temperatures, "C" or "K".
        kinematics: `Axisymmetric()` (default) or `PlaneStrain()`.
        displacement: (u_r, u_z) of a deformed body, a Function or UFL expression on the mesh, length; None: at rest.
        tolerance: the largest estimated error of one step, degrees.
        max_steps: more are not taken.

    Raises:
        InputError: something of this is not allowed.
        ConvergenceError: steps became too short, or too many.
    """
    if not isinstance(mesh, Mesh):
        raise InputError(f"heat: mesh = {mesh!r}: must come from formingx.mesh (disc, read, ...)")
    known("heat: unit", unit, ABSOLUTE_ZERO)
    materials = checked_materials(mesh, materials)
    boundaries = checked_boundaries(mesh, boundaries, ABSOLUTE_ZERO[unit])
    outputs = _times(times)
    kinematics = Axisymmetric() if kinematics is None else kinematics
    if not hasattr(kinematics, "area_vector") or isinstance(kinematics, type):
        raise InputError(f"heat: kinematics = {kinematics!r}: must be Axisymmetric() or PlaneStrain()")
    if displacement is not None and getattr(displacement, "ufl_shape", None) != (2,):
        raise InputError(f"heat: displacement = {displacement!r}: must be a Function or expression (u_r, u_z)")
    tolerance = positive("heat: tolerance", tolerance)
    body = Conduction(mesh, materials, boundaries, kinematics, ABSOLUTE_ZERO[unit], displacement)
    try:
        _begin(body, start, unit)
        run = HeatRun(body, unit, outputs)
        _advance(run, body, outputs, tolerance, max_steps)
    finally:
        body.destroy()
    return run


def _begin(body: Conduction, start: Any, unit: str) -> None:
    if getattr(start, "unit", unit) != unit:
        raise InputError(f"heat: start: is in {start.unit!r}, this run in {unit!r}: must be in the same unit")
    T = fields.values_at(start, body.points, body.mesh, "heat: start")
    lowest = body.comm.allreduce(T.min(initial=np.inf), MPI.MIN)
    if lowest < ABSOLUTE_ZERO[unit]:
        raise InputError(f"heat: start: its lowest temperature is {lowest:.6g} {unit}: must be at least"
                         f" {ABSOLUTE_ZERO[unit]:g}, absolute zero")
    body.T.x.array[: len(T)] = T
    body.T.x.scatter_forward()


def _advance(run: HeatRun, body: Conduction, outputs: np.ndarray, tolerance: float, max_steps: int) -> None:
    """Step through the times of output, as the estimate of the error allows."""
    state, t, dt = run.states[0], 0.0, 1e-3 * outputs[0]
    for end in outputs:
        while t < end:
            trial = stepping.fitted(dt, end - t)
            found = stepping.step(body, state, trial)
            dt = stepping.next_length(trial, found.error, tolerance)
            if found.error > tolerance:
                if dt < 1e-13 * outputs[-1]:
                    raise ConvergenceError(f"heat: steps became shorter than {dt:.3g} at time {t:.6g}: the estimated"
                                           f" error does not fall below {tolerance:g}", run)
                continue
            if len(run.times) > max_steps:
                raise ConvergenceError(f"heat: max_steps = {max_steps}: taken by time {t:.6g}", run)
            t = float(end) if trial == end - t else t + trial
            state = found.state
            run.record(t, found)
    _log.info("heat: %d steps to time %g", len(run.times) - 1, t)


def checked_materials(mesh: Mesh, materials: Any) -> dict[str, ThermalProperties]:
    """{layer: `ThermalProperties`} of what a user gave, or an InputError."""
    if isinstance(materials, ThermalProperties):
        materials = dict.fromkeys(mesh.layers, materials)
    if not isinstance(materials, Mapping):
        raise InputError(f"heat: materials = {materials!r}: must be ThermalProperties(...), or {{layer: ...}}")
    for name, material in materials.items():
        known("heat: materials: layer", name, mesh.layers)
        instance(f"heat: materials[{name!r}]", material, ThermalProperties, "ThermalProperties(...)")
    missing = [name for name in mesh.layers if name not in materials]
    if missing:
        raise InputError(f"heat: layer {missing[0]!r} has no material: give its ThermalProperties")
    return dict(materials)


def checked_boundaries(mesh: Mesh, boundaries: Any, absolute_zero: float) -> list[Any]:
    """The laws of the faces that a user gave, or an InputError."""
    found = several("heat: boundaries", boundaries, "boundaries, such as Convection('top', h=40, air=20)")
    held = [b.on for b in found if isinstance(b, FixedTemperature)]
    for boundary in found:
        if not hasattr(boundary, "on") or not (hasattr(boundary, "flux") or hasattr(boundary, "check")) \
                or isinstance(boundary, type):
            raise InputError(f"heat: boundaries: {boundary!r} is not allowed here: must be a list of Convection,"
                             f" Radiation, HeatFlux, FixedTemperature, ContactWithTool, Absorption")
        known(f"heat: {boundary!r}: boundary", boundary.on, mesh.boundaries)
        if hasattr(boundary, "check"):
            boundary.check(mesh, absolute_zero)
        if boundary.on in held and hasattr(boundary, "check") and not isinstance(boundary, FixedTemperature):
            raise InputError(f"heat: {boundary!r}: the temperature of {boundary.on!r} is fixed, so this does nothing")
    return found


def _times(times: Any) -> np.ndarray:
    listed = [times] if np.ndim(times) == 0 and not isinstance(times, str) else several("heat: times", times, "times")
    found = np.array([positive("heat: times", finite("heat: times", t)) for t in listed])
    if not len(found) or np.any(np.diff(found) <= 0):
        raise InputError(f"heat: times = {times!r}: must be one time or several that grow")
    return found
