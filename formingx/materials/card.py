"""Material card: a page with the response of a material in three tests at forming rates, and its limits."""

import base64
import html
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, as_list, file_path, positive
from ..figures import figure
from .constants import OfTemperature
from .homogeneous import MODES

_LARGEST_STRETCH = 6.0
"""Largest stretch of the curves, if the material has no smaller limit."""

_STRETCH_FRACTION = 0.97
"""Largest stretch of the curves over the largest stretch of the material."""


def write(material: Any, file: Any, temperatures: Sequence[float], rates: Sequence[float], unit: str,
          unit_of_time: str) -> Path:
    """Write an HTML page of curves at temperatures and Hencky rates, and of limits, of a material; return its path."""
    caller, path = f"{material}: report", file_path("report: file", file)
    depends = [name for name, value in material.constants().items() if isinstance(value, OfTemperature)]
    values = as_list(f"{caller}: temperatures", temperatures, "temperatures")
    if depends and not values:
        raise InputError(f"{caller}: {', '.join(depends)} depend on the temperature: give temperatures=[...]")
    cases = [(f"{T:g}", material.at_temperature(T), _shift(material, T)) for T in values] if depends else [
        ("", material, 1.0)]
    rates = [positive(f"{caller}: rates", rate) for rate in as_list(f"{caller}: rates", rates, "rates")]
    parts = [_limits(name, entry, shift, unit, unit_of_time) for name, entry, shift in cases]
    picture = _picture(cases, rates if material.equilibrium is not material else [], unit, unit_of_time)
    if material.tested is not None:
        parts.append(material.tested.rows())
    rows = "".join(f"<tr><td>{html.escape(a)}</td><td>{html.escape(b)}</td></tr>" for part in parts for a, b in part)
    path.write_text(_PAGE.format(title=html.escape(type(material).__name__), card=html.escape(str(material)), rows=rows,
                                 picture=picture), encoding="utf-8")
    return path


def _shift(material: Any, temperature: float) -> float:
    """Return the shift factor aT of a material at a temperature, by which its relaxation times are multiplied."""
    law = material.parameters.get("aT")
    return float(law(temperature)) if isinstance(law, OfTemperature) else 1.0


def _limits(name: str, material: Any, shift: float, unit: str, unit_of_time: str) -> list[tuple[str, str]]:
    """Return rows (quantity, value) of a table for a material at one temperature: moduli and limits of stretch.

    `name`: the temperature, or ""; `shift`: factor of the relaxation times at it; units: of stress and time.
    """
    def with_unit(value: float, symbol: str = "") -> str:
        return f"{value:.4g} {symbol}".rstrip()
    rows = [("temperature", name)] if name else []
    rows.append(("instantaneous shear modulus", with_unit(material.shear_modulus, unit)))
    for mode in MODES:
        largest = material.largest_stretch(mode)
        if np.isfinite(largest):
            rows.append((f"largest stretch, {mode}", with_unit(largest)))
    for mode in MODES:
        if np.isfinite(most := material.rupture_stretch(mode)):
            rows.append((f"stretch at which it ruptures when stretched suddenly, {mode}", with_unit(most)))
    if material.branches:
        times = [shift * tau for _, tau in material.branches]
        rows.append(("relaxation times", f"{min(times):.3g} to {max(times):.3g} {unit_of_time}"))
        rest = material.equilibrium
        rows.append(("relaxed shear modulus", with_unit(rest.shear_modulus if rest else 0.0, unit)))
    elif not material.internal and material.equilibrium is material:
        top = min(_LARGEST_STRETCH, _STRETCH_FRACTION * material.largest_stretch("equibiaxial"))
        stable = material.check_stability((0.5, top))
        low, high = stable.drucker["equibiaxial"]
        rows.append(("stable (Drucker), equibiaxial",
                     f"at stretches from {low:.3g} to {high:.3g} (examined: {stable.stretches[0]:.3g} to {top:.3g})"))
    return rows


def _picture(cases: list[tuple[str, Any, float]], rates: list[float], unit: str, unit_of_time: str) -> str:
    """Return a PNG image, base64-encoded, with true stress over stretch in three tests.

    Cases: (temperature as text, material, factor of relaxation times); rates: Hencky, 1/time, if it relaxes.
    """
    drawn, axes = figure(3, width=4.2)
    for axis, mode in zip(axes, MODES):
        for k, (name, material, shift) in enumerate(cases):
            l = np.linspace(1.0, min(_LARGEST_STRETCH, _STRETCH_FRACTION * material.largest_stretch(mode)), 40)[1:]
            label = f"{name}: " * bool(name)
            if not rates:
                axis.plot(l, material.stress(mode, l, true=True), color=f"C{k}", label=name)
            for rate, style in zip(rates, ("-", "--", ":", "-.") * len(rates)):
                axis.plot(l, l * material.constant_rate(mode, rate * shift, l), style, color=f"C{k}",
                          label=f"{label}{rate:g}/{unit_of_time}")
        axis.set(title=mode.replace("_", " "), xlabel="stretch", ylabel="true stress" + f", {unit}" * bool(unit),
                 yscale="log" if rates else "linear")
    if rates or len(cases) > 1:
        words = ["temperature"] * bool(cases[0][0]) + ["rate"] * bool(rates)
        axes[0].legend(frameon=False, fontsize="small", title=": ".join(words))
    out = io.BytesIO()
    drawn.savefig(out, format="png", dpi=110)
    return base64.b64encode(out.getvalue()).decode()


_PAGE = """<!doctype html><html lang="en"><meta charset="utf-8"><title>{title}</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>body {{font: 15px/1.5 system-ui, "Segoe UI", Roboto, sans-serif; color: #1d2530; max-width: 72rem;
margin: 2rem auto; padding: 0 1rem}} table {{border-collapse: collapse}} img {{max-width: 100%}}
td {{padding: .3rem 1rem .3rem 0; border-bottom: 1px solid #e3e7ec}} code {{overflow-wrap: anywhere}}</style>
<h1>{title}</h1><p><code>{card}</code></p>
<img alt="true stress against stretch in three tests" src="data:image/png;base64,{picture}">
<h2>Limits</h2><table>{rows}</table>
<p>Not modelled: crystallisation during stretching or cooling, anisotropy, changes of volume under pressure, damage and
tearing. Beyond the stretches, rates and temperatures of the tests of its constants the response is a guess. A damping
function that was fitted to shear or uniaxial data is unknown in equibiaxial extension, the deformation of a sheet.</p>
</html>
"""
