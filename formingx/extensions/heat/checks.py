"""Checks of a scene with heat conduction (`Scene(heat=...)`), before and after a run."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...errors import InputError
from ...findings import Finding, percent, register
from ...materials.constants import OfTemperature
from ...materials.solidification import Solidification
from ...ranks import gathered
from ...values.temperature import ABSOLUTE_ZERO, FunctionOfTemperature
from ...values.tolerances import MEASURED_ACCURACY
from .boundaries import is_implausible
from .cooling_history import CoolingHistory
from .expansion import ThermalExpansion
from .layers import graded, height_at
from .run import checked_materials, implausible_diffusivities, implausible_radiation

_FROZEN = (", where the material does not relax any more: give Solidification or a modulus that rises, if it turns into"
           " glass")
_MODULUS_RATIO = 2.0
"""Equilibrium modulus at the lowest temperature over the modulus at the highest, above which a check warns."""

_ERROR_OF_ONE_LAYER = 0.14
"""Error over the span of temperatures with one layer of elements, for a face that is chilled suddenly.

This and the next two constants were measured with one to eight equal layers, after a hundredth of wall^2/diffusivity
(tests/test_heat_layers.py).
"""
_LAYER_ORDER = 1.75
"""Order of the error in the number of layers."""
_HALF_ERROR_BIOT = 2.0
"""Biot number (conductance times wall over conductivity) at which the error is half the error at an infinite one."""


def error_of_layers(layers: float, biot: float) -> float:
    r"""Return the relative temperature error of n equal layers of elements in a sheet with a chilled face.

    .. math:: e = 0.14 \, \frac{Bi}{Bi + 2} \, n^{-1.75}

    The constants are fitted to computed errors at the time 0.01 h^2/a, with the thickness h of the sheet and its
    diffusivity a. Biot number Bi: conductance of the face times thickness over conductivity. The error is relative to
    the span of temperatures.
    """
    return _ERROR_OF_ONE_LAYER * _biot_factor(biot) * layers ** -_LAYER_ORDER


def layers_needed(biot: float) -> int:
    """Return the number of equal layers that keep `error_of_layers` below 1 % after sudden cooling of a face."""
    return max(1, int(np.ceil((_ERROR_OF_ONE_LAYER * _biot_factor(biot) / MEASURED_ACCURACY) ** (1 / _LAYER_ORDER))))


def _biot_factor(biot: float) -> float:
    """Return the error of coarse layers at a Biot number over the error at an infinite one, dimensionless."""
    return 1.0 if np.isinf(biot) else biot / (biot + _HALF_ERROR_BIOT)


@register("scene")
def coarse_layers(body: Any) -> Iterator[Finding]:
    """Yield a warning for the chilled face with the largest error of too few layers below it; collective."""
    scene = body.scene
    if scene.heat is None or scene.kinematics.components == 3:      # a sheet has columns of its own
        return
    conductivity = min(m.conductivity for m in checked_materials(scene.mesh, scene.heat.materials).values())
    found = []
    for face, conductance in sorted(scene.heat.conductances(scene).items()):
        height, biot = height_at(scene.mesh, face), conductance * body.thickness / conductivity
        layers, needed = body.thickness / height, layers_needed(biot)
        if layers < 0.99 * needed:                          # round-off
            found.append((error_of_layers(layers, biot), face, height, needed))
    if not found:
        return
    error, face, height, needed = max(found)
    advice = ""
    if face in ("bottom", "top"):
        sizes = graded(scene.mesh, [face], body.thickness / needed / height, np.inf)
        advice = f", such as elements=(n, {[float(f'{size:.2g}') for size in sizes]}), from the bottom up"
    yield Finding("warning", f"boundary {face!r}",
                  f"it is chilled, and the elements along it are {height:.3g} thick, in a wall of {body.thickness:.3g}:"
                  f" temperatures will be off by about {percent(error)} of their span: use {needed} layers of equal"
                  f" elements, or thin ones at this face{advice}")


@register("scene")
def stiffening_on_cooling(body: Any) -> Iterator[Finding]:
    """Yield a warning for each constant that is more than twice as large at the lowest temperature as at the highest.

    The stress of the stretched part then grows on cooling: it springs back, while a solidified part keeps its shape.
    """
    scene = body.scene
    if scene.heat is None:
        return
    low, high = scene.heat.extremes(scene)
    for layer, material in scene.materials.items() if np.isfinite([low, high]).all() else ():
        if isinstance(material, Solidification):            # the stiffness added on cooling is free of stress
            continue
        relaxed = material.equilibrium
        for name, value in {} if relaxed is None else relaxed.constants().items():
            if not isinstance(value, OfTemperature):
                continue
            try:
                cold, hot = value.clamped(np.array([low, high]))
            except InputError:                              # the run raises it, if it reaches the temperature
                continue
            if cold > _MODULUS_RATIO * hot > 0:
                yield Finding("warning", f"layer {layer!r}",
                              f"{name}, of the relaxed material, is {cold / hot:.3g} times as large at {low:.4g}"
                              f" degrees as at {high:.4g}: as the stretched part cools, it pulls back with that much"
                              f" more force, instead of solidifying in its shape. For a material that solidifies see"
                              f" fx.Solidification and docs/heat.md")


@register("start")
def implausible_units(body: Any) -> Iterator[Finding]:
    """Yield warnings for temperatures, conductances and diffusivities that no polymer process has; collective.

    A body has from 200 to 680 K, its surroundings at least 200 K, and the Biot number is at most 1e4.
    """
    scene = body.scene
    if scene.heat is None:
        return
    zero = ABSOLUTE_ZERO[scene.heat.unit]
    hottest = max(scene.mesh.comm.allgather(scene.temperature.T.x.array.max(initial=-np.inf)))
    coldest, _ = scene.heat.extremes(scene)
    if hottest - zero > 680 or np.isfinite(coldest) and coldest - zero < 200:
        yield Finding("warning", "temperature", f"the body is up to {hottest:.4g} hot, body or surroundings down to"
                      f" {coldest:.4g} cold, with Cooling(unit={scene.heat.unit!r}). Polymers are formed between 200"
                      f" and 680 K: are these degrees Celsius, 'C', or kelvin, 'K'?")
    materials = checked_materials(scene.mesh, scene.heat.materials).values()
    conductivity = min(material.conductivity for material in materials)
    for face, conductance in scene.heat.conductances(scene).items():
        biot = conductance * body.thickness / conductivity
        if is_implausible(biot):
            yield Finding("warning", f"boundary {face!r}", f"its conductance {conductance:g} is {biot:.2g} times"
                          f" conductivity over thickness: are both in one system of units? 1000 W/(m2 K) is 1e-3 in W,"
                          f" mm and K")
    for text in [*implausible_diffusivities(materials, body.length),
                 *implausible_radiation(materials, scene.heat.boundaries, body.thickness, zero)]:
        yield Finding("warning", "heat", text)


@register("scene")
def unused_temperature(body: Any) -> Iterator[Finding]:
    """Yield a warning if nothing in the scene depends on its temperature."""
    scene = body.scene
    constants = [value for material in scene.materials.values() for value in material.constants().values()]
    if not (scene.temperature is None or scene.heat is not None or scene.expansion
            or any(contact.friction_by_temperature for contact in scene.contacts)
            or any(isinstance(value, OfTemperature) for value in constants)):
        yield Finding("warning", "temperature", "no constant of a material, no friction and no expansion depends on it,"
                      " so it has no effect: give constants as table({T: value}) or of_temperature(f), or leave it out")


@register("start")
def implausible_expansion(body: Any) -> Iterator[Finding]:
    """Yield a warning for each layer whose lengths change by more than 20 % from the stress-free temperature."""
    scene = body.scene
    if not scene.expansion:
        return
    T = gathered(scene.mesh.comm, scene.temperature.T.x.array)
    ends = [T.min(), T.max(), *(scene.heat.extremes(scene) if scene.heat is not None else ())]
    for layer, law in scene.expansion.items():
        if not isinstance(law, ThermalExpansion):
            continue
        found = {end: float(law.stretch(end, clamped=True)) for end in ends if np.isfinite(end)}
        end = max(found, key=lambda T: abs(np.log(found[T])))
        if not 0.8 < found[end] < 1.2:
            yield Finding("warning", f"expansion of {layer!r}", f"from {law.stress_free:.4g} to {end:.4g} degrees its"
                          f" lengths change by a factor of {found[end]:.3g}: polymers change by at most 0.1. Are all"
                          f" volumes in one unit, and all temperatures, too?")


@register("start")
def heat_without_time(body: Any) -> Iterator[Finding]:
    """Yield a warning if a `Cooling` has no stage that takes time."""
    if body.scene.heat is not None and body.has_targets and not any(stage.timed for stage in body.stages):
        yield Finding("warning", "heat", "the run takes no time, so that no heat is conducted: give stages of a Process"
                      " a speed, a duration or a table over time")


@register("start")
def beyond_known_range(body: Any) -> Iterator[Finding]:
    """Yield warnings for constants whose range is smaller than that of body, tools, air and heaters; collective."""
    if body.scene.heat is not None:
        low, high = body.scene.heat.extremes(body.scene)
        yield from _outside_known_range(body.scene, low, high, "the tools and the air may bring it")


@register("end")
def passed_known_range(path: Any) -> Iterator[Finding]:
    """Yield warnings for ends of constants' ranges that the temperature passed, unless warned before; collective."""
    reported = {finding.about for finding in path.record.findings}
    states = path.record.segments[-1].states
    for k, history in enumerate(path.problem.history.parts):
        if isinstance(history, CoolingHistory):
            limits = path.problem.temperature.limits             # elements overshoot next to a chilled face
            temperatures = [np.clip(state.history_variables[k].temperature, *limits) for state in states]
            local = [f(T) for T in temperatures if len(T) for f in (np.min, np.max)]
            ends = [value for part in path.problem.comm.allgather(local) for value in part]
            found = _outside_known_range(path.problem.scene, min(ends), max(ends), "the run brought it")
            yield from (finding for finding in found if finding.about not in reported)


def _outside_known_range(scene: Any, low: float, high: float, cause: str) -> Iterator[Finding]:
    """Yield warnings for constants unknown at `low` or `high`; `cause` is subject and verb of the message."""
    laws = [(f"materials[{layer!r}]", name, value) for layer, material in scene.materials.items()
            for name, value in material.constants().items()]
    laws += [(repr(contact), "friction", contact.mu) for contact in scene.contacts]
    laws += [(f"expansion of {layer!r}", "volume", law.specific_volume) for layer, law in scene.expansion.items()]
    reported = set()
    for about, name, law in laws:
        if not isinstance(law, FunctionOfTemperature):
            continue
        span = 1e-9 * (high - low) if np.isfinite(high - low) else 0.0
        for beyond, limit, words in ((low, law.limits[0], "below"), (high, law.limits[1], "above")):
            outside = beyond < limit - span if words == "below" else beyond > limit + span
            if np.isfinite(beyond) and outside and (about, words, limit) not in reported:
                reported.add((about, words, limit))
                yield Finding("warning", about,
                              f"{name} = {law!r} is known {'down' if words == 'below' else 'up'} to {limit:.4g}"
                              f" degrees, and {cause} to {beyond:.4g}: {words} {limit:.4g} it is taken as it is there"
                              f"{_FROZEN if words == 'below' and 'WLF' in repr(law) else ''}. Give values to there")


@register("end")
def temperature_errors(path: Any) -> Iterator[Finding]:
    """Yield a warning if the mesh is too coarse for the temperature, in states on the last mesh; collective."""
    for history in path.problem.history.parts:
        if isinstance(history, CoolingHistory):
            yield from history.findings(path.record.segments[-1].states)
