"""Loads, defined by their virtual work."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import ufl

from ..errors import InputError, check_type, finite, positive
from .kinematics import cofactor_change
from .part import ScenePart


class Load(ScenePart):
    """Base class of loads, also of user-defined ones; a subclass must define `virtual_work`.

    Args:
        on: name of the boundary on which the load acts; None for a body force.
        value: fixed value of the load, in the user's units; None: the value is a load parameter (control) of the run.
        name: name of the load in the stages of a `Process` and in the column names of results.
    """

    quantity = "load"

    def __init__(self, on: str | None = None, value: float | None = None, name: str | None = None):
        self.on, self.name = on, name
        caller = f"{type(self).__name__}{'' if on is None else f'({on!r})'}"
        self.value = None if value is None else finite(f"{caller}: value", value)

    @property
    def driven(self) -> bool:
        """True if the value of the load is a load parameter (control) of the run, False if it is fixed."""
        return self.value is None

    def virtual_work(self, body: Any, value: Any) -> Any:
        """Return the virtual work of the load for a virtual displacement of the body.

        Args:
            body: a `formingx.forms.loaded_body.LoadedBody`. It has the displacement `u`, the virtual displacement `du`,
                the reference position `X`, the deformation gradient `F`, and integrals by `integral` and `face`.
            value: value of the load (UFL scalar, user's units).

        Returns:
            UFL form, linear in `body.du`.
        """
        raise NotImplementedError

    def mode_work(self, body: Any, value: Any) -> Any:
        """Return the first-order change of the virtual work by a non-axisymmetric mode, for the stability analysis.

        Args:
            body: a `formingx.forms.loaded_body.LoadedBody` with three more members. `mode` has the displacement
                amplitudes (u_r, u_z, u_hoop) of the mode, `dmode` of its variation (UFL, shape (3,), length).
                `H` is the change of the deformation gradient by the mode (UFL, shape (3, 3)).
            value: value of the load (UFL scalar, user's units).

        Returns:
            UFL form, bilinear in `body.mode` and `body.dmode`; None for a dead load.

        Raises:
            InputError: the class of the load does not define this method.
        """
        raise InputError(f"{self!r}: stability: how it changes with a mode is not known: give the load a method"
                         f" mode_work(body, value) that returns a form, or None if it does not")

    def unit(self, body: Any) -> float:
        r"""Return the unit of the load: its value divided by its dimensionless amplitude.

        By default the nodal forces :math:`f_i` of a unit load in the reference configuration add up to

        .. math:: \sum_i |f_i| = \frac{\mu V}{L}

        with the largest shear modulus mu, the volume V and the largest extent L of the body.

        Args:
            body: a `formingx.forms.loaded_body.LoadedBody`.

        Returns:
            The value, in the user's units.
        """
        return body.unit(self)

    def __repr__(self) -> str:
        given = [repr(v) for v in (self.on, self.value) if v is not None]
        return f"{type(self).__name__}({', '.join(given)})"


class Pressure(Load):
    r"""Follower pressure on a boundary, normal to the deformed face (Song 1993, section 3.3).

    .. math:: \delta W = -p \int_{\gamma} n \cdot \delta u \, da = -p \int_{\Gamma} J F^{-T} N \cdot \delta u \, dA

    Nanson's formula pulls the integral over the deformed face (normal n) back to the reference face (normal N) exactly.
    F is the deformation gradient and J its determinant. The unsymmetric load stiffness is part of the tangent.

    Args:
        on: name of the boundary. A positive pressure pushes into the body.
        value: fixed pressure (stress); None: the pressure is a load parameter (control) of the run.
        name: name of the load in the stages of a `Process` and in the column names of results.
        above: reference height: the pressure acts on the part of the boundary with Z (in three dimensions z) above it,
            such as the part of a tube above its pinch-off; length. None: on all of the boundary. In three dimensions a
            triangle belongs to the part if its centroid does.

    >>> scene.driven                                                                  # `trace` finds its value
    Pressure('bottom')
    """

    quadrature_degree = 5
    quantity = "pressure"

    described = ("above",)

    def __init__(self, on: str, value: float | None = None, name: str | None = None, *, above: float | None = None):
        super().__init__(check_type("Pressure: on", on, str, "the name of a boundary"), value, name)
        self.above = None if above is None else finite("Pressure: above", above)

    def share(self, body: Any) -> Any:
        """Return the share of the pressure at the position `body.X`, 1 or 0 (UFL scalar; 1 if it acts everywhere)."""
        if self.above is None:
            return 1
        return ufl.conditional(ufl.gt(body.X[len(body.X) - 1], body.constant(self.above)), 1.0, 0.0)

    def virtual_work(self, body, value):
        face = body.face(self.on, self.quadrature_degree)
        area = body.kinematics.area_vector(body.u, body.X, face.normal)         # with its weight
        return -value * self.share(body) * ufl.inner(area, body.du) * face.measure

    def mode_work(self, body, value):
        r"""Return the change of the virtual work of the pressure by a non-axisymmetric mode v.

        .. math:: -p \int_{\Gamma} \left(\delta \, \mathrm{cof} F[H] \, N\right) \cdot \delta v \, dA

        H is the change of the deformation gradient F by the mode, and N the reference normal.
        `formingx.physics.kinematics.cofactor_change` gives the change of the cofactor.
        """
        face = body.face(self.on, self.quadrature_degree)
        N = ufl.as_vector([face.normal[0], face.normal[1], 0])
        return -value * face.integral(self.share(body) * ufl.inner(cofactor_change(body.F, body.H) * N, body.dmode))

    def __repr__(self) -> str:
        return super().__repr__() if self.above is None else f"{super().__repr__()[:-1]}, above={self.above:g})"

    def unit(self, body):
        r"""Return the unit of the pressure: its value divided by its dimensionless amplitude.

        .. math:: p = \frac{\mu \, h}{L}, \qquad h = \frac{V}{A}

        Here mu is the largest shear modulus, L the largest extent and V the volume of the body, and A the loaded area.
        """
        return body.stress * body.thickness(self.on) / body.length


class Gravity(Load):
    r"""Weight of the body along -Z, a dead load.

    .. math:: \delta W = -\int_{V} \rho \, g \, \delta u_z \, dV

    Args:
        density: density rho in the reference configuration, positive; {layer: density} if only some layers have weight.
            Its unit is kg/m3 with Pa, m and s, and t/mm3 with MPa, mm and s.
        value: acceleration g, length/time^2, such as 9.81 m/s2 or 9810 mm/s2, negative for an upward load; None: g is a
            load parameter (control) of the run.
        name: name of the load in the stages of a `Process` and in the column names of results.

    >>> fx.Gravity(density=0.95e-9, value=9810.0)                                        # t/mm3, mm/s2
    Gravity(9810.0)
    """

    symmetric = True

    def __init__(self, density: Any, value: float | None = None, name: str | None = None):
        super().__init__(None, value, name)
        self.density = _density("Gravity", density)

    def virtual_work(self, body, value):
        return -value * _weighed(body, self.density, body.du[body.kinematics.components - 1])

    def mode_work(self, body, value):
        return None


class CentrifugalLoad(Load):
    r"""Centrifugal force on a body that rotates about the axis R = 0.

    .. math:: \delta W = \int_{V} \rho \, \omega^2 (R + u_r) \, \delta u_r \, dV

    Args:
        density: density rho in the reference configuration, positive; {layer: density} if only some layers have mass.
            Its unit is kg/m3 with Pa, m and s, and t/mm3 with MPa, mm and s.
        value: omega^2, the square of the angular speed, 1/time^2; None: omega^2 is a load parameter (control) of the
            run.
        name: name of the load in the stages of a `Process` and in the column names of results.

    >>> fx.CentrifugalLoad(density=0.95e-9, value=100.0**2)                                         # t/mm3; 100 rad/s
    CentrifugalLoad(10000.0)
    """

    symmetric = True

    def __init__(self, density: Any, value: float | None = None, name: str | None = None):
        super().__init__(None, value, name)
        self.density = _density("CentrifugalLoad", density)

    def virtual_work(self, body, value):
        return value * _weighed(body, self.density, (body.X[0] + body.u[0]) * body.du[0])

    def mode_work(self, body, value):
        r"""Return the change of the virtual work of the centrifugal force by a mode of amplitudes (U, W, V).

        .. math:: \int_{\Omega} \rho \, \omega^2 (U \, \delta U + V \, \delta V) \, d\Omega

        U, W and V are the amplitudes along r, z and the hoop direction. Omega is the reference volume, rho the density
        and omega the angular speed.
        """
        return value * _weighed(body, self.density, body.mode[0] * body.dmode[0] + body.mode[2] * body.dmode[2])


def _density(caller: str, given: Any) -> dict[str | None, float]:
    """Return {layer: density} from the argument `density` of a load; the layer None stands for all layers."""
    each = given if isinstance(given, Mapping) else {None: given}
    return {layer: positive(f"{caller}: density", value) for layer, value in each.items()}


def _weighed(body: Any, density: dict[str | None, float], integrand: Any) -> Any:
    """Return the integral of {layer: density} times a UFL scalar over the reference volume; None: all layers."""
    return sum(body.integral(body.constant(rho) * integrand, layer) for layer, rho in density.items())
