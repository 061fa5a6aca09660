"""Output quantities that a run records in each state, the columns of a path: standard and user-defined ones."""

from collections.abc import Callable, Mapping
from typing import Any

from ..contact import resultants
from ..contact.tooling import Tooling
from ..errors import InputError
from ..physics.loads import Gravity
from .forces import positive_direction, support_factor, tool_factor
from .quantities import Quantity, Sag, WholePartQuantity
from .relaxed import PoleStressRatio
from .targets import Amplitude, Target, bind_pole_height, bind_pole_stretch, bind_volume, swept_volume

Measure = Target | Callable[[Any], float]
"""Quantity of a user-defined column, see `formingx.trace`."""


class _Recorded(Quantity):
    """Base class of quantities that depend on more than displacements and control, such as on history variables."""

    smooth = False


class _Scalar(_Recorded):
    """Quantity :math:`f(I)` of an integral I: `form` is the UFL form of I, of rank 0, and `function` is f."""

    def __init__(self, problem, form, function):
        self._problem, self._form, self._function = problem, problem.forms.compile(form), function

    def value(self, x, control):
        self._problem.set_state(x, control)
        return self._function(self._problem.assemble_scalar(self._form))


class _Nodal(_Recorded):
    """Sum or maximum over the active contacts of a quantity of each contact; 0 if no contact is active.

    `quantity`: function of a contact, owned unknowns, control; `reduce`: sum or max; `contacts`: None for all.
    """

    def __init__(self, problem, quantity, reduce, contacts=None):
        self._problem, self._quantity, self._reduce = problem, quantity, reduce
        self._contacts = problem.contacts if contacts is None else contacts

    def value(self, x, control):
        active = [c for c in self._contacts if c in self._problem.contact.faces]
        return float(self._reduce([0.0, *[self._quantity(contact, x.array_r, control) for contact in active]]))


class _Reaction(_Recorded):
    """Force of the body on a driven support along its component; `number` is its index in `Scene.items`."""

    def __init__(self, problem, number):
        self._problem, self._number = problem, number

    def value(self, x, control):
        return self._problem.reaction(self._number, x, control)


class _Ratio(_Recorded):
    """Ratio of the Mises stress at the pole to its value after complete relaxation at the same deformation."""

    def __init__(self, problem):
        self._problem, self._ratio = problem, PoleStressRatio(problem)

    def value(self, x, control):
        self._problem.set_state(x, control)
        return self._ratio.evaluate()


class _UserDefined(_Recorded):
    """User-defined quantity: `function` takes the problem and returns a number; `name` is the name of its column."""

    def __init__(self, problem, name, function):
        self._problem, self._name, self._function = problem, name, function

    def value(self, x, control):
        self._problem.set_state(x, control)
        found = self._function(self._problem)
        try:
            return float(found)
        except (TypeError, ValueError):
            raise InputError(f"record: {self._name!r} gave {found!r}: must be a number") from None


def user_defined(problem: Any, columns: Mapping[str, Measure], taken: Mapping[str, Quantity]) -> dict[str, Quantity]:
    """Return {column: quantity} that a user adds, from a target or a function of the `Problem` for each.

    A name that is `taken` or no word, or another value, is an InputError.
    """
    if not isinstance(columns, Mapping):
        raise InputError(f"record = {columns!r}: must be {{name: measure}}")
    found: dict[str, Quantity] = {}
    for name, measure in columns.items():
        if not isinstance(name, str) or not name or name in taken:
            raise InputError(f"record: name = {name!r}: must be a word that is no column yet; columns are"
                             f" {', '.join(taken)}")
        if isinstance(measure, Target):
            found[name] = measure.bind(problem)
        elif callable(measure):
            found[name] = _UserDefined(problem, name, measure)
        else:
            raise InputError(f"record: {name} = {measure!r}: must be a function of the problem, or a target")
    return found


def standard(problem: Any, timed: bool = False) -> dict[str, Quantity]:
    r"""Return the output quantities that every run records.

    Energies, volumes, areas and forces belong to the whole part, tool and support, also where a half or a quarter is
    modelled (`Scene.symmetry_factor`). In plane strain they are per unit depth. Columns:

    - pressure (stress), travel (length): controlled quantities. Several controls have a column each, such as
      plug_travel (`Scene.column`).
    - pole_height (length), pole_stretch: for a body with a boundary "axis".
    - enclosed_volume (length^3): for a scene with a controlled pressure.
    - strain_energy (stress length^3): recoverable energy of the body.
    - mass_error, volume_error: mean and root mean square of J - 1 over the reference volume V,

      .. math:: \frac{1}{V} \int (J - 1) \, dV, \qquad \left[\frac{1}{V} \int (J - 1)^2 \, dV\right]^{1/2}

      with the volume ratio J to the thermally expanded body.

    - sag (length): largest downward displacement, for a scene with `Gravity`.
    - contact_length (length): reference length in contact, for a section with contacts. In three dimensions the columns
      are contact_area (deformed) and reference_contact_area (length^2).
    - penetration (length): penetration of the deepest contact point, for a scene with contacts.
    - tool_force: force of the body on the only tool; of several tools, tool_1_force for the first contact. A tool named
      "plug" also has plug_force. The force counts along the travel, positive when it resists; for a fixed tool along Z,
      positive upwards.
    - support_force: force of the body on a driven support along its component; plug_force if the support is named
      "plug" and there are several controls.
    - process_time (time): if `timed`.
    - dissipated_power (stress length^3 over time): for relaxing materials. A run also records its integral,
      dissipated_energy (stress length^3).
    - pole_stress_ratio: Mises stress at the pole over its equilibrium value (`PoleStressRatio`), for relaxing materials
      with a known equilibrium and a body with a boundary "axis".
    - damage_energy (stress length^3): energy dissipated by damage, for materials with a rate-independent history.
    """
    scene, forms, volume = problem.scene, problem.forms, problem.forms.volume
    energy = scene.symmetry_factor * forms.stress * volume
    found: dict[str, Quantity] = {"process_time": Amplitude(problem, -1)} if timed else {}
    for i, item in enumerate(scene.items):
        if any(item is t for t in scene.drivable):
            found[column := scene.column(item)] = Amplitude(problem, i)
            if item in scene.supports:
                found["support_force" if column == item.quantity else f"{item.name}_force"] = (
                    WholePartQuantity(_Reaction(problem, i), support_factor(scene, item)))
    if "axis" in scene.mesh.boundaries:
        found["pole_height"] = bind_pole_height(problem)
        found["pole_stretch"] = bind_pole_stretch(problem)
    if any(isinstance(load, Gravity) for load in scene.loads):
        found["sag"] = Sag(problem)
    pressed = any(item.quantity == "pressure" for item in scene.drivable)
    change = forms.J - 1
    mass, error = change * forms.weight * forms.dx, change**2 * forms.weight * forms.dx
    swept = swept_volume(problem) if pressed else None
    forms.compile_ahead(swept, forms.energy, mass, error, forms.dissipation,
                        forms.damage_energy)
    if pressed:
        found["enclosed_volume"] = bind_volume(problem, swept)
    if forms.energy is not None:
        found["strain_energy"] = _Scalar(problem, forms.energy, lambda v: v * energy)
    found["mass_error"] = _Scalar(problem, mass, lambda v: v / volume)
    found["volume_error"] = _Scalar(problem, error, lambda v: (v / volume) ** 0.5)
    if forms.dissipation is not None:
        found["dissipated_power"] = _Scalar(problem, forms.dissipation, lambda v: v * energy)
        if PoleStressRatio.known(problem):
            found["pole_stress_ratio"] = _Ratio(problem)
    if forms.damage_energy is not None:
        found["damage_energy"] = _Scalar(problem, forms.damage_energy, lambda v: v * energy)
    if problem.contacts:
        factors = {c: tool_factor(scene, c.contact) for c in problem.contacts}
        positive = {c: positive_direction(c.contact) for c in problem.contacts}
        sizes = {"contact_length": resultants.length} if scene.kinematics.components == 2 else {
            "contact_area": resultants.area, "reference_contact_area": resultants.length}
        for column, size in sizes.items():
            found[column] = _Nodal(problem, lambda c, *state, size=size: factors[c] * size(c, *state), sum)
        found["penetration"] = _Nodal(problem, resultants.penetration, max)
        tooling = Tooling.of_problem(problem)
        tools = {name: [c for c, tool in zip(problem.contacts, tooling.names, strict=True) if tool == name]
                 for name in tooling.force_columns}
        for name in sorted(tools, key=lambda tool: tools[tool][0].contact.direction is None):  # moving tools come first
            force = _Nodal(problem, lambda c, *state: factors[c] * (resultants.force(c, *state) @ positive[c]), sum,
                           tools[name])
            found[tooling.force_columns[name]] = force
            if tools[name][0].contact.name:
                found[f"{name}_force"] = force
    return found
