"""The measures that every run records: the columns of a path."""

from collections.abc import Callable, Mapping
from typing import Any

from ..contact import resultants
from ..contact.tooling import Tooling
from ..errors import InputError
from ..physics.loads import Gravity
from .forces import resisting, support_factor, tool_factor
from .relaxed import PoleStressRatio
from .targets import (
    Amplitude,
    Bound,
    OfWholePart,
    Sag,
    Target,
    bind_pole_height,
    bind_pole_stretch,
    bind_volume,
    swept_volume,
)

Measure = Target | Callable[[Any], float]
"""Quantity of a user's own column, see `formingx.trace`."""


class _Recorded(Bound):
    """A measure that depends on more than the displacements: between two states it cannot be evaluated for a guessed
    body."""

    smooth = False


class _Scalar(_Recorded):
    """of(v), where v is the value of a scalar form."""

    def __init__(self, problem, form, of):
        self._problem, self._form, self._of = problem, problem.forms.compile(form), of

    def value(self, x, control):
        self._problem.set_state(x, control)
        return self._of(self._problem.assemble_scalar(self._form))


class _Nodal(_Recorded):
    """over([0, of(contact), ...]) of the active contacts."""

    def __init__(self, problem, of, over, contacts=None):
        self._problem, self._of, self._over = problem, of, over
        self._contacts = problem.contacts if contacts is None else contacts

    def value(self, x, control):
        active = [c for c in self._contacts if c in self._problem.present]
        return float(self._over([0.0, *(self._of(contact, x.array_r, control) for contact in active)]))


class _Reaction(_Recorded):
    """Force of the body on a driven support (by its number in the scene)."""

    def __init__(self, problem, number):
        self._problem, self._number = problem, number

    def value(self, x, control):
        return self._problem.reaction(self._number, x, control)


class _Ratio(_Recorded):
    """See `PoleStressRatio`."""

    def __init__(self, problem):
        self._problem, self._ratio = problem, PoleStressRatio(problem)

    def value(self, x, control):
        self._problem.set_state(x, control)
        return self._ratio.now()


class _Own(_Recorded):
    """A function of the problem, by the user."""

    def __init__(self, problem, name, function):
        self._problem, self._name, self._function = problem, name, function

    def value(self, x, control):
        self._problem.set_state(x, control)
        found = self._function(self._problem)
        try:
            return float(found)
        except (TypeError, ValueError):
            raise InputError(f"record: {self._name!r} gave {found!r}: must be a number") from None


def own(problem: Any, columns: Mapping[str, Measure], taken: Mapping[str, Bound]) -> dict[str, Bound]:
    """Return the user's columns.

    Raises:
        InputError: a name that is taken or not a word, or a column that is neither a target nor a function.
    """
    if not isinstance(columns, Mapping):
        raise InputError(f"record = {columns!r}: must be {{name: measure}}")
    found: dict[str, Bound] = {}
    for name, measure in columns.items():
        if not isinstance(name, str) or not name or name in taken:
            raise InputError(f"record: name = {name!r}: must be a word that is no column yet; columns are"
                             f" {', '.join(taken)}")
        if isinstance(measure, Target):
            found[name] = measure.bind(problem)
        elif callable(measure):
            found[name] = _Own(problem, name, measure)
        else:
            raise InputError(f"record: {name} = {measure!r}: must be a function of the problem, or a target")
    return found


def standard(problem: Any, timed: bool = False) -> dict[str, Bound]:
    """Return the measures that every run records, by column name.

    Energies, volumes, areas and forces belong to the whole part, the whole tool and the whole support, also
    where a half or a quarter is modelled (`Scene.symmetry_factor`); in plane strain they are per unit depth.

    pressure (or travel: a length), pole_height (length), pole_stretch, enclosed_volume (length^3), strain_energy
    (stress length^3), mass_error (volume over its original value, minus 1), volume_error (root mean square of J - 1),
    both over what thermal expansion makes of the volume. Pole and volume are there where the scene has an axis and a
    driven pressure. With `Gravity`: sag, the largest downward displacement (length). With contacts: contact_length
    (reference length in touch), in three dimensions contact_area (of the deformed sheet) and reference_contact_area
    (of the flat one), penetration (of the deepest node, length) and the force of the body on each tool: along
    its travel, positive when it resists; of a tool that stays along Z, positive when the body pushes it up. It is
    plug_force for one named "plug" (tool_1_force for one without a name), and tool_force where there is one tool. With
    a driven support: support_force (of the body on it, along its component). Where several items can be driven each
    has its column, plug_travel for one named "plug" (`Scene.column`), a support plug_force. `timed`: process_time too.
    With materials that relax: dissipated_power (stress length^3 over time), and from it, in a run, dissipated_energy
    (stress length^3); with an axis and a known equilibrium, pole_stress_ratio: the Mises stress at the pole over the
    one in equilibrium (`PoleStressRatio`). With a rate-independent history: damage_energy (stress length^3).
    """
    scene, forms, volume = problem.scene, problem.forms, problem.forms.volume
    energy = scene.symmetry_factor * forms.stress * volume
    found: dict[str, Bound] = {"process_time": Amplitude(problem, -1)} if timed else {}
    for i, item in enumerate(scene.items):
        if any(item is t for t in scene.drivable):
            found[column := scene.column(item)] = Amplitude(problem, i)
            if item in scene.supports:
                found["support_force" if column == item.quantity else f"{item.name}_force"] = (
                    OfWholePart(_Reaction(problem, i), support_factor(scene, item)))
    if "axis" in scene.mesh.boundaries:
        found["pole_height"] = bind_pole_height(problem)
        found["pole_stretch"] = bind_pole_stretch(problem)
    if any(isinstance(load, Gravity) for load in scene.loads):
        found["sag"] = Sag(problem)
    pressed = any(item.quantity == "pressure" for item in scene.drivable)
    change = forms.J - 1
    mass, error = change * forms.weight * forms.dx, change**2 * forms.weight * forms.dx
    forms.compile_ahead(swept_volume(problem) if pressed else None, forms.energy, mass, error, forms.dissipation,
                        forms.damage_energy)
    if pressed:
        found["enclosed_volume"] = bind_volume(problem)
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
        sizes = {"contact_length": resultants.length} if scene.kinematics.components == 2 else {
            "contact_area": resultants.area, "reference_contact_area": resultants.length}
        for column, size in sizes.items():
            found[column] = _Nodal(problem, lambda c, *at, size=size: factors[c] * size(c, *at), sum)
        found["penetration"] = _Nodal(problem, resultants.penetration, max)
        tooling = Tooling.of_problem(problem)
        tools = {name: [c for c, tool in zip(problem.contacts, tooling.names, strict=True) if tool == name]
                 for name in tooling.force_columns}
        for name in sorted(tools, key=lambda tool: tools[tool][0].contact.direction is None):  # moving tools come first
            force = _Nodal(problem, lambda c, *at: factors[c] * (resultants.force(c, *at) @ resisting(c.contact)), sum,
                           tools[name])
            found[tooling.force_columns[name]] = force
            if tools[name][0].contact.name:
                found[f"{name}_force"] = force
    return found
