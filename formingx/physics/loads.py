"""Loads: each gives its virtual work."""

from __future__ import annotations

from typing import Any

import ufl

from ..errors import InputError, finite, instance
from .kinematics import cofactor_change
from .part import Part


class Load(Part):
    """The base of all loads, also of a user's own: `virtual_work` is all that it must give.

    Args:
        on: name of the boundary that it acts on; None: it acts in the body.
        value: a fixed value, in the user's units; None: it is what the run controls.
        name: what it is called in a process and in its columns.
    """

    quantity = "load"

    def __init__(self, on: str | None = None, value: float | None = None, name: str | None = None):
        self.on, self.name = on, name
        who = f"{type(self).__name__}{'' if on is None else f'({on!r})'}"
        self.value = None if value is None else finite(f"{who}: value", value)

    @property
    def driven(self) -> bool:
        """True if the run controls this load."""
        return self.value is None

    def virtual_work(self, body: Any, value: Any) -> Any:
        """The virtual work of the load at a value, which may be a UFL expression: a UFL form, linear in `body.du`.

        Args:
            body: a `formingx.discrete.formulation.LoadedBody`: u, du, X, F, kinematics, `integral`, `face`.
        """
        raise NotImplementedError

    def mode_work(self, body: Any, value: Any) -> Any:
        """Of its virtual work, the change by a mode that varies round the body: a UFL form, or None of a dead load.

        Bilinear in `body.dmode` and `body.mode`: amplitudes (u_r, u_z, u_hoop), shape (3,), length.

        Args:
            body: as in `virtual_work`; `body.H`, shape (3, 3): by how much the mode changes F.
        """
        raise InputError(f"{self!r}: stability: how it changes with a mode is not known: give the load a method"
                         f" mode_work(body, value) that returns a form, or None if it does not")

    def unit(self, body: Any) -> float:
        """The value at which a driven load counts as one: a run takes its steps in parts of it.

        By default the forces at rest then add up to shear modulus times volume over length of the body.
        """
        return body.unit(self)

    def __repr__(self) -> str:
        given = [repr(v) for v in (self.on, self.value) if v is not None]
        return f"{type(self).__name__}({', '.join(given)})"


class Pressure(Load):
    """Follower pressure on a tagged boundary: it stays normal to the deformed face (Song 1993, section 3.3).

    dW = -p integral over the deformed face of n . du, pulled back by Nanson's formula and integrated exactly; its
    (unsymmetric) load stiffness is part of the tangent.

    Args:
        on: name of the boundary. A positive pressure pushes into the body.
        value: a fixed pressure (stress); None: the pressure is what the run controls.
        name: what it is called in a process and in its columns.
    """

    quadrature_degree = 5
    quantity = "pressure"

    def __init__(self, on: str, value: float | None = None, name: str | None = None):
        super().__init__(instance("Pressure: on", on, str, "the name of a boundary"), value, name)

    def virtual_work(self, body, value):
        face = body.face(self.on, self.quadrature_degree)
        area = body.kinematics.area_vector(body.u, body.X, face.normal)         # with its weight
        return -value * ufl.inner(area, body.du) * face.measure

    def mode_work(self, body, value):
        face = body.face(self.on, self.quadrature_degree)
        N = ufl.as_vector([face.normal[0], face.normal[1], 0])
        return -value * face.integral(ufl.inner(cofactor_change(body.F, body.H) * N, body.dmode))

    def unit(self, body):
        """Stress times thickness over length, thickness being the volume of the body over the loaded area."""
        return body.stress * body.thickness(self.on) / body.length
