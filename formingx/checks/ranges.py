"""Checks of quantities against the range for polymers, and of the side on which a pressure acts."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..findings import Finding, register
from ..physics.loads import CentrifugalLoad, Gravity
from ..values.table import Table
from ..values.tolerances import LARGEST_FRICTION, ROUND_OFF
from .mould_side import moulds, sign_towards
from .sizes import LARGEST_LOAD, SizedBody

_LONGEST_IN_METRES = 5.0        # longest body whose length may be in metres
_SHORTEST_IN_MICROMETRES = 1e3  # shortest body whose length may be in micrometres
_SMALLEST_MODULUS = 1e-7        # shear modulus: 0.1 Pa in MPa
_LARGEST_MODULUS = 1e11         # shear modulus: 100 GPa in Pa
_LARGEST_MODULUS_IN_MM = _LARGEST_MODULUS / 1e6   # for a length in mm: 100 GPa in MPa, 100 MPa in kPa, 690 MPa in psi


@register("start")
def moduli(body: SizedBody) -> Iterator[Finding]:
    """Report shear moduli that no polymer has in one of the usual systems of units."""
    for layer, value in body.moduli.items():
        in_mm = _LONGEST_IN_METRES < body.length < _SHORTEST_IN_MICROMETRES
        largest = _LARGEST_MODULUS_IN_MM if in_mm else _LARGEST_MODULUS
        if not _SMALLEST_MODULUS < value < largest:
            yield Finding("warning", f"materials[{layer!r}]",
                          f"its shear modulus is {body.format(value, 'stress')} and the body"
                          f" {body.format(body.length, 'travel')} long: no polymer has that modulus in mm and MPa, m"
                          f" and Pa, or in and psi. Are the units of stress and length of one system?")


@register("start")
def friction(body: SizedBody) -> Iterator[Finding]:
    """Report coefficients of friction above 5; rubber on dry steel reaches 4."""
    for contact in body.scene.contacts:
        if contact.sticks:
            continue
        table = getattr(contact.mu, "function", None) if contact.friction_by_temperature else None
        value = float(table.y.max()) if isinstance(table, Table) else contact.mu
        if isinstance(value, float) and value > LARGEST_FRICTION:
            yield Finding("warning", repr(contact),
                          f"its coefficient of friction is {value:.4g}: polymers on metal have 0.05 to 1, rubber up to"
                          f" 4. Is it a percentage? For a sheet that sticks use 'stick'")


@register("start")
def weight(body: SizedBody) -> Iterator[Finding]:
    """Report weights and centrifugal loads that are far too large or too small for the shear modulus of the body."""
    for load in body.scene.loads:
        if not isinstance(load, Gravity | CentrifugalLoad) or load.value is None:
            continue
        size = body.length if isinstance(load, Gravity) else body.length**2
        stress = max(load.density.values()) * abs(load.value) * size
        ratio = stress / max(body.moduli.values())
        if ratio > LARGEST_LOAD or 0 < ratio < ROUND_OFF:
            what = "tears the body apart" if ratio > 1 else "moves nothing"
            yield Finding("warning", repr(load),
                          f"density x acceleration x length is {ratio:.2g} times the shear modulus"
                          f" {body.format(max(body.moduli.values()), 'stress')}, and {what}: with mm and MPa the"
                          f" density is in t/mm3 (1e-9 for water) and the acceleration in mm/s2; with m and Pa, kg/m3"
                          f" and m/s2")


@register("start")
def pressures(body: SizedBody) -> Iterator[Finding]:
    """Report a scene whose pressures all push the body away from its moulds."""
    acting = [pressure for pressure in body.pressures() if pressure.item is not None and pressure.value]
    found = moulds(body.scene) if acting else []
    towards = [np.sign(value) * sign_towards(contact, load) for load, _, value, _ in acting for contact in found]
    if max(towards, default=0.0) < 0:
        load, _, value, text = acting[0]
        yield Finding("warning", text,
                      f"it pushes the body away from the mould {found[0].name or found[0].on!r}: {load!r} acts"
                      f" {'on the face that touches the mould' if value > 0 else 'as suction on the other face'}. Put"
                      f" the pressure on the other face, or change its sign")
