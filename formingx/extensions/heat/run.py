"""Heating and cooling over time: `heat`."""

import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from ... import _compat
from ...errors import ConvergenceError, InputError, as_list, check_name, check_type, finite, positive
from ...mesh import Mesh
from ...mesh.nodes import dof_positions, span
from ...physics.kinematics import Axisymmetric
from ...scene import fields
from ...values.temperature import ABSOLUTE_ZERO
from . import stepping
from .boundaries import Absorption, FixedTemperature, Radiation, ThermalProperties, is_implausible, numbers_of
from .conduction import Conduction
from .layers import layered
from .result import HeatRun
from .space_error import SpaceError

WARNED_ERROR = 3e-4
"""Discretisation error, over the span of temperatures in a run, above which a warning is logged."""
_FIRST_ACCURATE_TIME = 0.01
"""Earliest time, over the duration of a run, at which temperatures are as accurate as at the output times."""

_log = logging.getLogger(__name__)


def heat(mesh: Mesh, materials: ThermalProperties | Mapping[str, ThermalProperties], boundaries: Sequence[Any] = (), *,
         start: Any, times: Any, unit: str, kinematics: Any = None, displacement: Any = None, tolerance: float = 1e-3,
         max_steps: int = 10000) -> HeatRun:
    """Compute the heat conduction in a body over time, from t = 0.

    Args:
        mesh: mesh of the body, from `formingx.mesh`. A boundary without a law is insulated.
        materials: {layer: `ThermalProperties`}, or one for all layers.
        boundaries: list of `Convection`, `Radiation`, `HeatFlux`, `FixedTemperature`, `ContactWithTool` and
            `Absorption`; several on one boundary add up.
        start: initial temperature: a number, a `table` over R, a function of arrays (R, Z), or a CSV file with columns
            R, Z, T. Also an earlier `HeatRun` (its end), or a DOLFINx Function.
        times: output times, positive and increasing, or the end alone. Steps end at these times, and the run at the
            last.
        unit: unit of all temperatures, "C" or "K".
        kinematics: `Axisymmetric()` (default) or `PlaneStrain()`.
        displacement: (u_r, u_z) of a deformed body, a Function or UFL expression on the mesh, length; None: the
            reference configuration.
        tolerance: largest estimated error of one step, degrees.
        max_steps: maximum number of steps.

    Returns:
        The temperatures over time.

    Raises:
        InputError: an argument that is not allowed.
        ConvergenceError: the tolerance needs steps that are too short, or more than `max_steps`.

    >>> sheet = fx.mesh.disc(radius=20.0, thickness=2.0, elements=(4, 2))
    >>> polymer = fx.ThermalProperties(conductivity=0.2, density=1e-3, heat_capacity=2000.0)
    >>> run = fx.heat(sheet, polymer, [fx.Convection("top", h=0.01, air=20.0)], start=180.0, times=[10.0], unit="C")
    >>> [round(spot.temperature, 2) for spot in (run.coldest(), run.hottest())]
    [171.33, 178.44]
    """
    if not isinstance(mesh, Mesh):
        raise InputError(f"heat: mesh = {mesh!r}: must come from formingx.mesh (disc, read, ...)")
    check_name("heat: unit", unit, ABSOLUTE_ZERO)
    materials = checked_materials(mesh, materials)
    boundaries = checked_boundaries(mesh, boundaries, ABSOLUTE_ZERO[unit])
    outputs = _times(times)
    kinematics = Axisymmetric() if kinematics is None else kinematics
    if not hasattr(kinematics, "area_vector") or isinstance(kinematics, type):
        raise InputError(f"heat: kinematics = {kinematics!r}: must be Axisymmetric() or PlaneStrain()")
    if displacement is not None and getattr(displacement, "ufl_shape", None) != (2,):
        raise InputError(f"heat: displacement = {displacement!r}: must be a Function or expression (u_r, u_z)")
    tolerance = positive("heat: tolerance", tolerance)
    sizes = np.ptp(span(mesh.domain, mesh.comm), axis=0)
    for text in [*implausible_diffusivities(materials.values(), float(sizes.max())),
                 *implausible_radiation(materials.values(), boundaries, float(sizes.min()), ABSOLUTE_ZERO[unit])]:
        _log.warning("heat: %s", text)
    moved = None if displacement is None else _Displacement(displacement, mesh)
    fine = layered(mesh, _depths(materials, boundaries, outputs), moved)
    make = partial(Conduction, fine, materials, boundaries, kinematics, ABSOLUTE_ZERO[unit],
                   displacement if moved is None or fine is mesh else moved.on_mesh(fine))
    body = make()
    try:
        _set_initial_temperature(body, start, unit)
        run = HeatRun(body, unit, outputs)
        _advance(run, body, outputs, tolerance, max_steps)
        _check_error(run, SpaceError(body, make(degree=3)), tolerance)
    finally:
        body.destroy()
    return run


def _depths(materials: Mapping[str, ThermalProperties], boundaries: Sequence[Any],
            times: np.ndarray) -> dict[str, tuple[float, float]]:
    """Return {boundary: (smallest, largest) penetration depth of heat, length}, sqrt(a t) with diffusivity a.

    The smallest has the first output time, at least `_FIRST_ACCURATE_TIME` of the last. Absorption limits it to 1 /
    absorption coefficient.
    """
    slowest = min(material.diffusivity for material in materials.values())
    fastest = max(material.diffusivity for material in materials.values())
    first = np.sqrt(slowest * min(times[0], _FIRST_ACCURATE_TIME * times[-1]))
    last = np.sqrt(fastest * times[-1])
    depths: dict[str, tuple[float, float]] = {}
    for law in boundaries:
        depth = 1 / law.coefficient if isinstance(law, Absorption) else first
        depths[law.on] = min(depth, depths.get(law.on, (depth,))[0]), last
    return depths


class _Displacement:
    """Displacement of a body, length, as a quadratic `Function`, at points or on another mesh; collective."""

    def __init__(self, displacement: Any, mesh: Mesh):
        space = fem.functionspace(mesh.domain, ("Lagrange", 2, (2,)))
        u = fem.Function(space)
        u.interpolate(_compat.compile_expression(displacement, _compat.interpolation_points(space)))
        self._mesh, self._parts = mesh, [u.sub(k).collapse() for k in (0, 1)]

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Return the deformed positions of reference points, both of shape (n, 2), length."""
        return points + np.column_stack([fields.values_at(part, points, self._mesh, "heat: displacement")
                                         for part in self._parts])

    def on_mesh(self, mesh: Mesh) -> fem.Function:
        """Return the displacement as a quadratic `Function` on another mesh of the same body, length."""
        u = fem.Function(fem.functionspace(mesh.domain, ("Lagrange", 2, (2,))))
        points = dof_positions(u.function_space)
        u.x.array[:] = (self(points) - points).ravel()
        return u


def _set_initial_temperature(body: Conduction, start: Any, unit: str) -> None:
    """Set the initial temperature `T` of a body; below absolute zero, or in another unit, it is an InputError."""
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
    """Integrate from time 0 to the last output time, and record the accepted steps in the run.

    `tolerance` is the estimated error of a step, degrees. Too short or too many steps raise a ConvergenceError.
    """
    state, t, dt = run.states[0], 0.0, 1e-3 * outputs[0]
    for end in outputs:
        while t < end:
            trial = stepping.fitted(dt, end - t)
            found = stepping.step(body, state, trial)
            dt = stepping.next_length(trial, found.error, tolerance)
            if found.error > tolerance:
                if dt < 1e-13 * outputs[-1]:
                    raise ConvergenceError(f"heat: steps became shorter than {dt:.3g} at time {t:.6g}: the estimated"
                                           f" error does not fall below {tolerance:g}: are all laws in one system of"
                                           f" units?", run)
                continue
            if len(run.times) > max_steps:
                raise ConvergenceError(f"heat: max_steps = {max_steps} were used up at time {t:.6g}", run)
            t = float(end) if trial == end - t else t + trial
            state = found.state
            run.record(t, found)
    _log.info("heat: %d steps to time %g", len(run.times) - 1, t)


def _check_error(run: HeatRun, estimator: SpaceError, tolerance: float) -> None:
    """Set the discretisation errors of a run at its output times, and warn if they are large; frees the estimator.

    Large is above `tolerance`, degrees, and above `WARNED_ERROR` times the span of temperatures in the run.
    """
    try:
        run.errors_in_space = np.array([estimator.largest(run.states[k], run.times[k])[0]
                                        for k in np.searchsorted(run.times, run.outputs)])
    finally:
        estimator.destroy()
    allowed = max(tolerance, WARNED_ERROR * (max(run.hottest(t).temperature for t in run.times)
                                        - min(run.coldest(t).temperature for t in run.times)))
    worst = int(np.argmax(run.errors_in_space))
    if run.errors_in_space[worst] > allowed:
        _log.warning("heat: the error in space is about %.2g degrees at time %g, more than %.2g: use more elements"
                     " along the body, or through it where it is curved", run.errors_in_space[worst],
                     run.outputs[worst], allowed)


def implausible_diffusivities(materials: Iterable[ThermalProperties], length: float) -> Iterator[str]:
    """Yield a text for each diffusivity outside 1e-8 to 1e-5 m2/s, in every unit that suits the length of the body.

    Lengths may be in m, cm, mm, um or in, if the body is then from 0.1 mm to 20 m long.
    """
    metres = np.array([1.0, 1e-2, 1e-3, 1e-6, 0.0254])
    metres = metres[(length * metres > 1e-4) & (length * metres < 20)]
    for value in sorted({material.diffusivity for material in materials}):
        if not np.any((value * metres**2 > 1e-8) & (value * metres**2 < 1e-5)):
            yield (f"the diffusivity, conductivity / (density heat_capacity), is {value:.3g}, and the body {length:.3g}"
                   f" long: polymers have about 1e-7 m2/s, 0.1 mm2/s. Are conductivity, density, heat capacity and"
                   f" lengths in one system of units?")


def implausible_radiation(materials: Iterable[ThermalProperties], boundaries: Iterable[Any], thickness: float,
                           zero: float) -> Iterator[str]:
    """Yield a text for each radiation that heats a face far faster than conduction cools it, as in mixed units.

    Between a heater of 1000 K and 2 mm of a polymer the Biot number is about 2.
    """
    conductivity = min(material.conductivity for material in materials)
    for law in boundaries:
        if isinstance(law, Radiation):
            sigma, hottest = (max(numbers_of(given))
                              for given in map(law.parameters.__getitem__, ("stefan_boltzmann", "heater")))
            biot = 4 * sigma * (hottest - zero)**3 * thickness / conductivity
            if is_implausible(biot):
                yield (f"{law!r}: heat by radiation, 4 sigma T^3, is {biot:.2g} times conductivity over thickness: are"
                       f" all in one system of units? sigma is 5.67e-8 in W, m and K, and 5.67e-14 in W, mm and K:"
                       f" stefan_boltzmann=5.67e-14")


def checked_materials(mesh: Mesh, materials: Any) -> dict[str, ThermalProperties]:
    """Return {layer: `ThermalProperties`} from one for all layers or by layer; missing ones are an InputError."""
    if isinstance(materials, ThermalProperties):
        materials = dict.fromkeys(mesh.layers, materials)
    if not isinstance(materials, Mapping):
        raise InputError(f"heat: materials = {materials!r}: must be ThermalProperties(...), or {{layer: ...}}")
    for name, material in materials.items():
        check_name("heat: materials: layer", name, mesh.layers)
        check_type(f"heat: materials[{name!r}]", material, ThermalProperties, "ThermalProperties(...)")
    missing = [name for name in mesh.layers if name not in materials]
    if missing:
        raise InputError(f"heat: layer {missing[0]!r} has no material: give its ThermalProperties")
    return dict(materials)


def checked_boundaries(mesh: Mesh, boundaries: Any, absolute_zero: float) -> list[Any]:
    """Return the checked laws of faces and heat sources that a user gave.

    An InputError names an unknown law, boundary, a temperature below absolute zero, a table too short, or a second law
    on a fixed face.
    """
    found = as_list("heat: boundaries", boundaries, "boundaries, such as Convection('top', h=40, air=20)")
    prescribed = [b.on for b in found if isinstance(b, FixedTemperature)]
    for boundary in found:
        if not hasattr(boundary, "on") or not (hasattr(boundary, "flux") or hasattr(boundary, "check")) \
                or isinstance(boundary, type):
            raise InputError(f"heat: boundaries: {boundary!r} is not allowed here: must be a list of Convection,"
                             f" Radiation, HeatFlux, FixedTemperature, ContactWithTool, Absorption")
        check_name(f"heat: {boundary!r}: boundary", boundary.on, mesh.boundaries)
        if hasattr(boundary, "check"):
            boundary.check(mesh, absolute_zero)
        if boundary.on in prescribed and hasattr(boundary, "check") and not isinstance(boundary, FixedTemperature):
            raise InputError(f"heat: {boundary!r}: the temperature of {boundary.on!r} is fixed, so this does nothing")
    return found


def _times(times: Any) -> np.ndarray:
    """Return the output times, shape (n,); raise an InputError unless they are positive and increasing."""
    listed = [times] if np.ndim(times) == 0 and not isinstance(times, str) else as_list("heat: times", times, "times")
    found = np.array([positive("heat: times", finite("heat: times", t)) for t in listed])
    if not len(found) or np.any(np.diff(found) <= 0):
        raise InputError(f"heat: times = {times!r}: must be one time or several that grow")
    return found
