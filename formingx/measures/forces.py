"""Force of the body on a controlled support or tool, as the target of a run."""

from typing import Any

import numpy as np
import ufl
from dolfinx import fem

from ..contact import resultants
from ..errors import InputError, check_name, finite
from .quantities import Quantity, WholePartQuantity
from .targets import Target


def positive_direction(contact: Any) -> np.ndarray:
    """Return -m/|m|, (components,), the direction of positive forces by the `travel_vector` m; +Z for a fixed tool."""
    up = np.eye(contact.tool.components)[-1]
    return up if contact.direction is None else -contact.travel_vector / np.linalg.norm(contact.travel_vector)


def tool_factor(scene: Any, contact: Any) -> int:
    """Return the force on a whole tool over that on its part in the model, a power of 2."""
    return int(scene.symmetry.factor_of(contact.tool.bounds, positive_direction(contact)))


def support_factor(scene: Any, support: Any) -> int:
    """Return whole over modelled force of a driven support, a power of 2 (`MirrorPlanes.factor_of`)."""
    (constraint,) = scene.kinematics.in_axes(support, support.constraints())
    nodes = scene.first.mesh.nodes_of(constraint.on)
    return int(scene.symmetry.factor_of(np.stack([nodes.min(0), nodes.max(0)]),
                                        np.eye(scene.kinematics.components)[constraint.component]))


def force(value: float, *, of: str | None = None) -> Target:
    r"""Return the target for the force of the body on a support (negative where it pulls) or tool (positive).

    It is the force of the body on the support or tool, not the force that moves it. On a support it counts along the
    driven component: a support that pulls the body in +z has a negative force, one that moves in -z and compresses it a
    positive one. On a tool it counts against its motion m, positive when the body resists. With the tractions t of the
    body on the tool

    .. math:: F = -\frac{m}{|m|} \cdot \int_{\Gamma_c} t \, dA

    It is the force on the whole tool or support, also where a half or a quarter is modelled (`Scene.symmetry_factor`).

    Args:
        value: the force, stress length^2; in plane strain per unit depth, stress length.
        of: name of the support or tool; None for the only one that the run or the stage controls.

    Returns:
        The target.

    >>> fx.Stage("press", control="plug", until=fx.force(100.0, of="plug"))
    Stage('press')
    """
    def bind(problem):
        scene = problem.scene
        found = {i: t for i, t in enumerate(scene.items) if t in scene.drivable and t.quantity == "travel"}
        if of is not None:
            check_name("force: of =", of, [t.name for t in found.values() if t.name])
            found = {i: t for i, t in found.items() if t.name == of}
        moving = {i: t for i, t in found.items() if problem.setting.rate[i]} or found
        if len(moving) != 1:
            raise InputError(f"force = {value:g}: the scene has {len(moving) or 'no'} supports or tools that can be"
                             f" driven" + ", say which with of=..." * bool(moving))
        number, item = next(iter(moving.items()))
        if item in scene.contacts:
            tools = [scene.items[i] for i in scene.same_tool(number)]
            return WholePartQuantity(_ToolForce(problem, [c for c in problem.contacts if c.contact in tools]),
                               tool_factor(scene, item))
        return WholePartQuantity(_SupportForce(problem, number), support_factor(scene, item))
    return Target("force" if of is None else f"{of}_force", finite("force", value), bind)


class _SupportForce(Quantity):
    """Force of the body on a driven support along its component; `number` is its index in `Scene.items`."""

    smooth = False

    def __init__(self, problem: Any, number: int):
        forms = problem.forms
        self._problem, self._number = problem, number
        self._scale = forms.stress * forms.volume / forms.length
        along = fem.Function(forms.space)
        along.x.array[problem.driven_unknowns(number)] = 1.0
        total = ufl.action(forms.residual, along)
        self._derivative = forms.compile(ufl.derivative(total, forms.w, forms.test_function()))
        self._by_control = [forms.compile(ufl.action(form, along))
                            for form in (forms.control_derivative, forms.time_derivative) if form is not None]
        self.size = self._scale

    def value(self, x, control):
        return self._problem.reaction(self._number, x, control)

    def equation(self, target):
        problem = self._problem

        def c(x, control, gradient):
            force = self.value(x, control)
            problem.fill(gradient, -problem.assemble(self._derivative))
            slope = -sum(problem.assemble_scalar(form) for form in self._by_control)
            return (force - target) / self._scale, slope
        return c


class _ToolForce(Quantity):
    """Force of the body on a tool, positive against its travel; `contacts` are all contact faces of the tool."""

    smooth = False

    def __init__(self, problem: Any, contacts: list[Any]):
        forms = problem.forms
        self._problem, self._contacts, self._direction = problem, contacts, positive_direction(contacts[0].contact)
        self._scale = self.size = forms.stress * forms.volume / forms.length

    def value(self, x, control):
        active = [c for c in self._contacts if c.active]
        return float(sum(resultants.force(contact, x.array_r, control) @ self._direction for contact in active))

    def equation(self, target):
        problem = self._problem

        def c(x, control, gradient):
            values, slope = np.zeros(problem.n_owned), 0.0
            for contact in self._contacts:
                by_control = np.zeros(problem.n_owned)
                blocks = contact.stiffness(x.array_r, control)
                direction = np.tile(self._direction, blocks.shape[1] // len(self._direction))
                np.add.at(values, contact.rule.dofs, np.einsum("i,nij->nj", direction, blocks))
                contact.add_control_derivative(by_control, x.array_r, control)
                slope += float(np.sum(by_control[contact.rule.dofs] @ self._direction))
            problem.fill(gradient, values)
            return (self.value(x, control) - target) / self._scale, problem.comm.allreduce(slope)
        return c
