"""Targets of a run, such as a pole height, a stretch, a volume, a pressure, a travel or a time."""

from typing import Any, NamedTuple

import numpy as np
import ufl

from ..errors import InputError, check_name, finite, pair, positive, triple
from ..forms.probes import probe
from ..physics.loads import Pressure
from .quantities import Form, Linear, Quantity, Sag, WholePartQuantity

_GAUSS = (0.5 - 12**-0.5, 0.5 + 12**-0.5)
"""Points of the two-point Gauss rule on [0, 1], each of weight 1/2."""


class Amplitude(Quantity):
    """Output quantity that is a pressure, a travel, the process time or the control itself.

    It has a number in `Scene.items`, -1 for the process time, None for the control. Between two stages the control goes
    from 0 to 1 and activates or deactivates loads: such a quantity is the load times the control, or 1 - control.
    """

    def __init__(self, problem: Any, number: int | None):
        self._problem, self._number = problem, number
        self._acts = number is not None and 0 <= number < len(problem.scene.loads)
        self._scale = 1.0 if number is None else problem.forms.scales[number]
        self.size = 0.0 if number == -1 else self._scale    # a process may be short in any unit of time

    @property
    def is_load(self) -> bool:
        """True if this is the value of a load, such as a pressure; False for a travel, the time or the control."""
        return self._acts

    @property
    def is_controlled(self) -> bool:
        """True if the amplitude changes with the control in the present stage."""
        return self._number is None or self._problem.setting.rate[self._number] != 0

    def _amplitude(self, control: float) -> float:
        """Return this pressure, travel or time over its scale, which is 1 for time and control, at a control."""
        if self._number == -1:
            return self._problem.forms.time_at(control)
        if self._number is None:
            return control
        setting = self._problem.setting
        return (setting.acting_amplitude if self._acts else setting.amplitude)(self._number, control)

    def value(self, x, control):
        """Return this pressure, travel, time or control at a control, in the user's units; x is not used."""
        return self._scale * self._amplitude(control)

    def equation(self, target):
        """Return the equation, linear in the control, that this quantity equals a target in the user's units.

        It sets dc/dx = 0, and returns the dimensionless residual c and its derivative by the control.
        """
        setting = self._problem.setting
        slope = 1.0 if self._number is None else setting.rate[self._number]
        if self._acts and setting.fading:                    # the load fades, or grows, as the control goes to 1
            slope = self._amplitude(1.0) - self._amplitude(0.0)
        base = self._amplitude(0.0)                          # subtracted first: a short ramp in time loses no digits

        def c(x, control, gradient):
            gradient.set(0)
            return slope * control - (target / self._scale - base), slope
        return c


class Target(NamedTuple):
    """Target of a run: an output quantity and the value that it is to reach.

    Attributes:
        name: name of the output quantity.
        value: its target value, in the user's units.
        bind: function of a `Problem` that returns the output quantity of this problem (`Quantity`).
        signed: True if the quantity changes sign with the control; False for a stretch, which may increase in both
            directions of the control.
    """

    name: str
    value: float
    bind: Any
    signed: bool = True

    def __repr__(self) -> str:
        return f"Target({self})"

    def __str__(self) -> str:
        return f"{self.name.replace('_', ' ')} = {self.value:g}"


def pressure(value: float, *, of: str | None = None) -> Target:
    """Return the target that a controlled pressure reaches a value.

    Args:
        value: the pressure, stress.
        of: name of the load; None for the only pressure that the run or the stage controls.

    Returns:
        The target.

    >>> round(float(path.state_at(fx.pressure(0.02)).measures["pole_height"]), 3)
    4.795
    """
    return _driven("pressure", value, of)


def travel(value: float, *, of: str | None = None) -> Target:
    """Return the target that a controlled support or tool has moved by a length from its initial position.

    Args:
        value: the travel, length.
        of: name of the support or tool; None for the only one that the run or the stage controls.

    Returns:
        The target.

    >>> fx.travel(6.0, of="plug").name
    'plug_travel'
    """
    return _driven("travel", value, of)


def process_time(value: float) -> Target:
    """Return the target that the process time, counted from the beginning of the process, reaches a value.

    Args:
        value: the process time.

    Returns:
        The target.

    >>> blow = fx.Stage("blow", amplitudes={scene.driven: [(0.0, 0.0), (2.0, 0.02)]}, until=fx.process_time(1.0))
    """
    return Target("process_time", finite("process_time", value), lambda problem: Amplitude(problem, -1))


def change_completed() -> Target:
    """Return the target (control 1) that ends the transition between two stages."""
    return Target("change", 1.0, lambda problem: Amplitude(problem, None))


def _driven(quantity: str, value: float, of: str | None) -> Target:
    """Return the target that a controlled "pressure" or "travel" reaches a value, stress or length.

    `of` names the load, support or tool; None is the only one. Binding raises an InputError if there is none, or
    several.
    """
    def bind(problem):
        scene, rate = problem.scene, problem.setting.rate
        found = [i for i, t in enumerate(scene.items)
                 if any(t is d for d in scene.drivable) and t.quantity == quantity]
        if of is not None:
            check_name(f"{quantity}: of =", of, [n for n in (scene.items[i].name for i in found) if n])
            return Amplitude(problem, next(i for i in found if scene.items[i].name == of))
        moving = [i for i in found if rate[i]] or found
        if len(moving) != 1:
            raise InputError(f"{quantity} = {value:g}: the scene has {len(moving) or 'no'} {quantity} that can be"
                             " driven" + (", say which with of=..." if moving
                                          else f"; items that can be driven are {scene.drivable}"))
        return Amplitude(problem, moving[0])
    return Target(quantity if of is None else f"{of}_{quantity}", finite(quantity, value), bind)


def pole_height(value: float) -> Target:
    """Return the target that the axial displacement u_z of the pole reaches a value.

    The pole is the material point on the axis at mid-thickness in the reference configuration.

    Args:
        value: the displacement u_z, length.

    Returns:
        The target.

    >>> round(float(path.state_at(fx.pole_height(6.0)).measures["pressure"]), 4)
    0.0289
    """
    return Target("pole_height", finite("pole_height", value), bind_pole_height)


def pole_stretch(value: float) -> Target:
    r"""Return the target that the in-plane stretch of the sheet at the pole, on the axis, reaches a value.

    The stretch is computed from the thickness h on the axis. In plane strain the sheet is stretched in one direction
    only:

    .. math:: \lambda = (h / h_0)^{-1/2} \text{ (axisymmetric)}, \qquad \lambda = (h / h_0)^{-1} \text{ (plane strain)}

    In a membrane it is 1 + du_r/dR. A run raises an InputError if a material of the scene cannot reach the stretch
    (Gent, Arruda-Boyce).

    Args:
        value: the stretch, positive.

    Returns:
        The target.

    >>> round(float(path.state_at(fx.pole_stretch(1.5)).measures["pole_stretch"]), 9)
    1.5
    """
    return Target("pole_stretch", positive("pole_stretch", value), bind_pole_stretch, signed=False)


def enclosed_volume(value: float) -> Target:
    r"""Return the target that the volume swept by the face under the controlled pressure reaches a value.

    .. math:: V = -\int_0^1 \int_{\Gamma} u \cdot a(t u) \, dS \, dt

    Here a(t u) is the area vector of the face at the displacement t u (`Kinematics.area_vector`). The volume lies
    between the reference and the deformed face; straight lines close it where an end of the face has moved. Where a
    half or a quarter is modelled, V is the volume of the whole part (`Scene.symmetry_factor`).

    Args:
        value: the volume, length^3; in plane strain per unit depth, length^2.

    Returns:
        The target.

    >>> round(float(path.state_at(fx.enclosed_volume(500.0)).measures["enclosed_volume"]), 6)
    500.0
    """
    return Target("enclosed_volume", finite("enclosed_volume", value), bind_volume)


def displacement(value: float, *, at: tuple[float, ...], component: str = "z") -> Target:
    """Return the target that a displacement component of a material point reaches a value.

    Args:
        value: the displacement that is to be reached, length; 0 is where the point was at the start.
        at: position of the point in the reference configuration, length: (R, Z), for a flat sheet in three dimensions
            (x, y), for another surface (x, y, z) of a node or of a point of a triangle.
        component: "r" or "z"; in three dimensions "x", "y" or "z".

    Returns:
        The target.

    Raises:
        InputError: the component is unknown.

    >>> fx.displacement(3.0, at=(5.0, 0.0)).name
    'u_z_at_5_0'
    """
    if isinstance(value, str):
        raise InputError(f"displacement: value = {value!r}: the first argument is the displacement that is to be"
                         f" reached, a length; the component is displacement(1.0, at={at!r}, component={value!r})")
    at = triple("displacement: at", at) if np.size(at) == 3 else pair("displacement: at", at)
    if not isinstance(component, str) or component not in ("r", "z", "x", "y"):
        raise InputError(f"displacement: component = {component!r}: must be 'r' or 'z' (in three dimensions"
                         " 'x', 'y' or 'z')")

    def bind(problem):
        axes = problem.scene.kinematics.axes
        check_name("displacement: component", component, axes)
        return _displacement(problem, [at], [[float(axis == component) for axis in axes]])
    return Target(f"u_{component}_at_{'_'.join(f'{v:g}' for v in at)}", finite("displacement", value), bind)


def sag(value: float) -> Target:
    """Return the target that the sag of the body, its largest displacement along -Z, reaches a value.

    Args:
        value: the sag, length, positive.

    Returns:
        The target.

    >>> fx.Stage("heat", duration=60.0, until=fx.sag(30.0))                              # until it hangs 30 mm
    Stage('heat')
    """
    return Target("sag", positive("sag", value), Sag)


def bind_pole_height(problem: Any) -> Quantity:
    """Return u_z, length, of the material point on the axis at mid-thickness as an output quantity."""
    low, high = _pole(problem)
    return _displacement(problem, [(0.0, (low + high) / 2)], [[0.0, 1.0]])


def bind_pole_stretch(problem: Any) -> Quantity:
    """Return the in-plane stretch at the pole, (h/h_0)^(-1/2), in plane strain (h/h_0)^-1, as an output quantity.

    Here h is the thickness on the axis, h_0 that on the first mesh of the run. In a membrane it is 1 + du_r/dR.
    """
    low, high = _pole(problem)
    pole = probe(problem, [(0.0, low), (0.0, high)])
    row, power = pole.stretch_row()
    earlier = 1 + float(pole.earlier_displacement[1, -1] - pole.earlier_displacement[0, -1]) / (high - low)
    return Linear(problem, row, earlier, lambda t: max(t, 1e-300) ** power, lambda s: s ** (1 / power))


def bind_volume(problem: Any, form: Any = None) -> Quantity:
    """Return the volume swept by the face under the controlled pressure, length^3, of the whole part."""
    modelled, images = _volume(problem, form), problem.scene.symmetry_factor
    return modelled if images == 1 else WholePartQuantity(modelled, images)


def _volume(problem: Any, form: Any = None) -> Quantity:
    """Return the volume swept by the loaded face of the modelled body as an output quantity.

    It includes the volume swept on earlier meshes. `form`: result of `swept_volume`; None to build it.
    """
    earlier = 0.0
    if problem.scene.state_transfer is not None:
        old, state = problem.scene.state_transfer.before
        with old.state_context(state):
            earlier = _volume(old).value(old.x, state.control)
    form = swept_volume(problem) if form is None else form
    return Form(problem, form, _unit_of_volume(problem.forms), earlier)


def _unit_of_volume(forms: Any) -> float:
    """Return the cube of the length scale of the forms; in plane strain its square, for a volume per unit depth."""
    return forms.length**forms.scene.kinematics.dimension_of_volume


def swept_volume(problem: Any) -> Any:
    r"""Return the form of the volume swept by the loaded face of the modelled body, over the cube of the length scale.

    .. math:: V = -\int_0^1 \int_{\Gamma} u \cdot a(t u) \, dS \, dt

    a(t u) is the area vector of the face at the displacement t u. For an axisymmetric body it is of degree 2 in t, so
    the two-point Gauss rule in t is exact. A scene without a controlled pressure with a face is an InputError.
    """
    driven = next((t for t in problem.scene.drivable if t.quantity == "pressure"), problem.scene.driven)
    if driven is None or driven.on is None:
        what = "no driven pressure whose face would enclose" if driven is None else f"{driven!r}, which has no face for"
        raise InputError(f"enclosed_volume: the scene has {what} it")
    kinematics, forms = problem.scene.kinematics, problem.forms
    N, face = forms.face(driven.on, 5)
    swept = sum(ufl.inner(forms.u, kinematics.area_vector(forms.constant(t) * forms.u, forms.X, N)) for t in _GAUSS)
    share = driven.share(forms) if isinstance(driven, Pressure) else 1
    return -share * swept / forms.constant(2 * _unit_of_volume(forms)) * face


def _displacement(problem, points, factors):
    """Return a sum of displacements of reference points (n, 2) with factors (n, components), length."""
    found = probe(problem, points)
    return Linear(problem, found.row(np.asarray(factors)) * problem.forms.length,
                   float(np.sum(factors * found.earlier_displacement)))


def _pole(problem):
    """Return lowest and highest Z on the "axis" of the first mesh, length; without one, an InputError."""
    mesh = problem.scene.first.mesh
    if "axis" not in mesh.boundaries:
        raise InputError(f"the pole needs a boundary named 'axis'; the mesh has {list(mesh.boundaries)}: elsewhere take"
                         f" displacement(..., at=..., component=...)")
    nodes = mesh.nodes_of("axis")
    return float(nodes[:, 1].min()), float(nodes[:, 1].max())


def is_met(target: Target, size: float, value: float) -> bool:
    """Return True if |v - v*| <= 1e-12 max(|v|, |v*|, size), with `Quantity.size`, in the user's units."""
    return abs(value - target.value) <= 1e-12 * max(abs(value), abs(target.value), size)
