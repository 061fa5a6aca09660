"""Checks of quantities against the range of all polymers, and of pressures against the side of the mould."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..findings import Finding, register
from ..physics.loads import CentrifugalLoad, Gravity
from ..values.table import Table
from .sizes import Body
from .towards import moulds, sign_towards

_ROUGHEST = 5.0            # coefficient of friction: rubber on dry steel has 1 to 4
_LARGE = 5.0               # length of a body that is no length in metres
_HUGE = 1e3                # length of a body from which on it may be one in micrometres
_STIFFEST = 1e5            # shear modulus with such a length: 100 GPa in MPa, 100 MPa in kPa, 690 MPa in psi
_SOFTEST = 1e-7            # shear modulus: 0.1 Pa in MPa
_HARDEST = 1e11            # shear modulus: 100 GPa in Pa
_HEAVIEST = 1e3            # weight over shear modulus: the body would fall apart
_LIGHTEST = 1e-10          # weight over shear modulus: it moves nothing


@register("start")
def moduli(body: Body) -> Iterator[Finding]:
    """Shear moduli that no polymer has in any usual system of units, with a body of this length."""
    for layer, value in body.moduli.items():
        most = _STIFFEST if _LARGE < body.length < _HUGE else _HARDEST
        if not _SOFTEST < value < most:
            yield Finding("warning", f"materials[{layer!r}]",
                          f"its shear modulus is {body.say(value, 'stress')} and the body"
                          f" {body.say(body.length, 'travel')} long: no polymer has that modulus in mm and MPa, m and"
                          f" Pa, or in and psi. Are the units of stress and length of one system?")


@register("start")
def friction(body: Body) -> Iterator[Finding]:
    """Coefficients of friction above the largest of rubber on steel."""
    for contact in body.scene.contacts:
        if contact.sticks:
            continue
        table = getattr(contact.mu, "function", None) if contact.friction_by_temperature else None
        most = float(table.y.max()) if isinstance(table, Table) else contact.mu
        if isinstance(most, float) and most > _ROUGHEST:
            yield Finding("warning", repr(contact),
                          f"its coefficient of friction is {most:.4g}: that of polymers on metal is 0.05 to 1, of"
                          f" rubber up to 4. Is it a percentage? For a sheet that sticks use 'stick'")


@register("start")
def weight(body: Body) -> Iterator[Finding]:
    """Weight and centrifugal forces against the stiffness of the body."""
    for load in body.scene.loads:
        if not isinstance(load, Gravity | CentrifugalLoad) or load.value is None:
            continue
        size = body.length if isinstance(load, Gravity) else body.length**2
        stress = max(load.density.values()) * abs(load.value) * size
        ratio = stress / max(body.moduli.values())
        if ratio > _HEAVIEST or 0 < ratio < _LIGHTEST:
            what = "tears the body apart" if ratio > 1 else "moves nothing"
            yield Finding("warning", repr(load),
                          f"density x acceleration x length is {ratio:.2g} times the shear modulus"
                          f" {body.say(max(body.moduli.values()), 'stress')}, and {what}: with mm and MPa the density"
                          f" is in t/mm3 (1e-9 for water) and the acceleration in mm/s2; with m and Pa, kg/m3 and m/s2")


@register("start")
def pressures(body: Body) -> Iterator[Finding]:
    """Pressures that all push the body away from every mould in front of it."""
    acting = [pressure for pressure in body.pressures() if pressure.item is not None and pressure.value]
    found = moulds(body.scene) if acting else []
    towards = [np.sign(value) * sign_towards(contact, load) for load, _, value, _ in acting for contact in found]
    if max(towards, default=0.0) < 0:
        load, _, value, text = acting[0]
        yield Finding("warning", text,
                      f"it pushes the body away from the mould {found[0].name or found[0].on!r}: {load!r} acts"
                      f" {'on the face of that mould' if value > 0 else 'as suction on the other face'}. Give the"
                      f" pressure to the other face, or turn its sign")
