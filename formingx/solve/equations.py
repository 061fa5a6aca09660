"""Interfaces of a problem F(x, control) = 0 for the solver, which uses nothing else of the problem.

In all members x is the vector of unknowns, and the control a number; both are dimensionless. The rows of x are
distributed over the ranks; an array holds the locally owned entries, shape (n,). `out` is a vector that receives the
result. In each step the solver calls these methods, in this order:

    contact.limit.length, prepare       Limit the step length. Prepare the contacts for the step.
    contact.begin                       Start Newton's method at the predicted state.
    residual                            Compute F. This and the next two lines are called in each iteration.
    contact.linearise                   Compute F and its active set for the linearisation.
    tangent, control_derivative         Compute dF/dx and dF/dcontrol, at the (x, control) of the residual.
    has_inverted_element                Check the converged state, as contact.limit.check and history.step_error do.
    history.advance                     Accept the state and update the history variables.
    tangent(one_sided=True)             Compute the tangent of the next step, which differs if F has a kink.

`state_context` and `restore` return to an earlier state. `enter` changes the step data between the stages of a process.
The defaults in this module suit equations without contact, history, time or units. A class derived from `Equations`
then only defines F.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from contextlib import AbstractContextManager
from os import PathLike
from typing import Any, NamedTuple, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from ..contact.face import FaceContact
from ..contact.step_limit import StepLimit
from ..forms.schedule import StepData
from ..forms.viscosity import Viscosity as Viscosity
from ..measures.quantities import Quantity as Quantity

Array: TypeAlias = npt.NDArray[Any]

Constraint = Callable[[PETSc.Vec, float, PETSc.Vec], tuple[float, float]]
"""Function (x, control, gradient) -> (c, dc/dcontrol) of a constraint c = 0; it sets the vector `gradient` to dc/dx."""


class ProblemState(Protocol):
    """Unknowns, control, time, history variables and step data of a state (the part of `State` that a problem needs).

    Attributes:
        x: the unknowns, locally owned entries, shape (n,), dimensionless.
        control: load parameter (control), dimensionless.
        time: process time.
        history_variables: history variables of the problem after this state, an entry for each history of the problem
            (contacts, materials, temperature).
        setting: step data, as a dict of the fields of `StepData`; empty for a problem without stages.
    """

    x: Array
    control: float
    time: float
    history_variables: list[Any]
    setting: dict[str, Any]


class Attempt(NamedTuple):
    """Last iterate of a failed run of Newton's method.

    Attributes:
        x: the unknowns, locally owned entries, shape (n,).
        control: load parameter (control), dimensionless.
        dx: last correction of x, locally owned entries, shape (n,).
        dcontrol: last correction of the control.
    """

    x: Array
    control: float
    dx: Array
    dcontrol: float


class Examined(Protocol):
    """Examination of a body in its last good state and in a failed attempt.

    Attributes:
        facts: {name of a field of `Diagnosis`: value}, such as the smallest J, residuals and the number of nodes in
            contact.
    """

    facts: dict[str, Any]

    def draw(self, file: str | PathLike[str], title: str) -> None:
        """Draw the last good state with a title, on rank 0; raise `InputError` if there is nothing to draw."""


class ReferenceConfiguration(Protocol):
    """The body in the reference configuration, x = 0, from which a path begins.

    Attributes:
        singular: True if dF/dx is singular there.
    """

    singular: bool = False

    def stiff_state(self, out: PETSc.Vec) -> None:
        """Compute in `out` unknowns near x = 0 with a regular dF/dx, from which the first tangent of a path follows."""
        return

    def motion(self, control: float) -> Array:
        """Return a first guess of x: the prescribed displacements at a control, else 0; locally owned, shape (n,)."""
        return np.zeros(1)


class ActiveSet(Protocol):
    """Contact of the body: the residual F has a kink where points close, open, begin to stick or begin to slide."""

    @property
    def faces(self) -> Sequence[FaceContact]:
        """Faces in contact that are active in the current stage. Without them F is smooth."""
        return []

    @property
    def limit(self) -> StepLimit | None:
        """Limits that contact sets to a step; None without limits."""
        return None

    @property
    def status(self) -> Hashable:
        """Contact status of all points at the residual last computed, the same on all ranks; None without contact."""
        return None

    def begin(self, old: ProblemState | None = None) -> None:
        """Start the increments of all contacts for a run of Newton's method, from the last accepted state or None."""
        return

    def linearise(self, x: PETSc.Vec, control: float, F: PETSc.Vec) -> None:
        """Linearise the contact law for an iteration at (x, control); its forces replace those in the residual F."""
        return

    def one_sided_changes(self, x: PETSc.Vec, control: float) -> list[Array]:
        """Return for each face the change of the contact stiffness for the next step from an accepted state.

        At a kink of F the stiffness there differs from that in the last tangent, which is subtracted. Shape (n, c, c),
        stress/length, for n points with c components.
        """
        return []

    def unit_forces(self, chosen: list[Array]) -> Array:
        """Return the residuals of unit forces at chosen owned points of each face, shape (n, m), 0 at constraints.

        The m columns are ordered by rank, face, point and component.
        """
        return np.zeros((0, 0))

    def activate(self, number: int, x: Array, control: float) -> None:
        """Activate contact `number` of `Scene.items` at (x, control); a tool inside the body is an InputError."""
        return


class Histories(Protocol):
    """History variables and process time, on which F may depend besides x and the control.

    Attributes:
        variables: history variables after the last accepted state, an entry for each history of the problem (contacts,
            materials, temperature).
        clock: process time at control 0.
        path_dependent: True if the residual F depends on earlier states, by a material, the temperature or friction.
        body_path_dependent: True if it depends on them by a material or the temperature, not only by contact.
        rate_dependent: True if F depends on process time, not only on the control.
    """

    variables: list[Any]
    clock: float
    path_dependent: bool = False
    body_path_dependent: bool = False
    rate_dependent: bool = False

    def advance(self, x: Array, control: float) -> None:
        """Update the history variables to the accepted state (x, control); x: locally owned entries, shape (n,)."""
        return

    def time_at(self, control: float) -> float:
        """Return the process time at a value of the control."""
        return self.clock

    def step_error(self, past: Sequence[ProblemState], share: Array, x: Array,
                   control: float) -> tuple[float, float]:
        """Estimate the time integration error of a step from the last of `past` to x, shape (n,).

        share: weights of `past` and of x that interpolate the unknowns halfway in time, shape (k + 1,). Return the
        relative error of the stress, and the part that remains if the body then relaxes at constant deformation for
        another duration of the step.
        """
        return 0.0, 0.0


class Description(Protocol):
    """Names, units and explanations of the numbers of a problem, for messages and results.

    Attributes:
        scales: value in the user's units over dimensionless amplitude of each item; at the end 1.0 for process time.
        units: unit of the dimensionless energy and unit of the dimensionless length, in the user's units.
        fixed_loads: loads that act already at control 0, as text.
        main_columns: names of the output quantities that `Record.describe` states.
    """

    scales: Sequence[float] = ()
    units: tuple[float, float] = (1.0, 1.0)
    fixed_loads: Sequence[str] = ()
    main_columns: Sequence[str] = ()

    @property
    def control_kind(self) -> str | None:
        """Kind of the controlled quantity: "pressure", "travel", "time" or, if it is none of them, None."""
        return None

    def shown(self, control: float) -> tuple[str, float]:
        """Return (name of the controlled quantity, its value in the user's units) at a value of the control."""
        return "control", control

    def implausible(self, control: float) -> str | None:
        """Return the reason, as text, for which no process reaches this value of the control; None if it may."""
        return None

    @property
    def why_not_finite(self) -> str:
        """Reason, as text, for which the residual last computed is infinite or not a number."""
        return "the equations are not defined there"

    def examine(self, last: ProblemState | None, attempt: Attempt | None) -> Examined | None:
        """Examine the body in the last good state and a failed attempt; None without a body; collective."""
        return None


class NoContact(ActiveSet):
    """Equations without contact."""


class NoHistories(Histories):
    """Equations without history variables, at process time 0."""

    def __init__(self) -> None:
        self.variables, self.clock = [], 0.0


class NoDescription(Description):
    """Equations without names and units."""


class RegularReference(ReferenceConfiguration):
    """Reference configuration with a regular dF/dx."""


class Equations(Protocol):
    """Interface of a problem F(x, control) = 0 for the solver: the residual F, its derivatives and its parts.

    Attributes:
        comm: MPI communicator.
        x: vector of unknowns; inside `state_context` it holds the unknowns of the state.
        matrix: tangent matrix, filled by `tangent`.
        force_scale: norm of the support forces at the residual last computed.
    """

    comm: MPI.Intracomm
    x: PETSc.Vec
    matrix: PETSc.Mat
    force_scale: float

    @property
    def reference(self) -> ReferenceConfiguration:
        """The body in the reference configuration."""
        return RegularReference()

    @property
    def contact(self) -> ActiveSet:
        """Contact of the body."""
        return NoContact()

    @property
    def history(self) -> Histories:
        """History variables and process time."""
        return NoHistories()

    @property
    def description(self) -> Description:
        """Names and units, for messages."""
        return NoDescription()

    @property
    def symmetric(self) -> bool:
        """True if dF/dx is symmetric."""
        return False

    def residual(self, x: PETSc.Vec, control: float, out: PETSc.Vec) -> None:
        """Compute F(x, control) in `out`, and set `force_scale`."""

    def tangent(self, x: PETSc.Vec, control: float, one_sided: bool = False) -> PETSc.Mat:
        """Compute and return dF/dx in `matrix`, at the unknowns x and a control.

        one_sided: True if the next step starts there. Where F has a kink, the derivative is then taken on its side.
        """

    def control_derivative(self, x: PETSc.Vec, control: float, out: PETSc.Vec, one_sided: bool = False) -> None:
        """Compute dF/dcontrol at (x, control) in `out`; `one_sided`: see `tangent`."""

    def inner(self, a: PETSc.Vec, b: PETSc.Vec) -> float:
        """Return the inner product of two changes a and b of x, from which arc length is computed; dimensionless.

        An example is the mean over the body of the products of displacements, over its squared size.
        """

    def metric_times(self, a: PETSc.Vec, out: PETSc.Vec) -> None:
        """Compute in `out` the product of the metric with a: out . b = inner(a, b) for every b."""

    def has_inverted_element(self, x: PETSc.Vec, control: float) -> bool:
        """Return True if an element is inverted at (x, control); the residual may be finite nevertheless."""
        return False

    def viscosity(self) -> Viscosity:
        """Return the viscosity of the body for a snap-through; the caller calls its `destroy`."""

    @property
    def setting(self) -> StepData:
        """Current step data: amplitudes as functions of the control, and inactive items."""

    def enter(self, setting: StepData, x: Array, control: float) -> None:
        """Set new step data, for a path that begins at (x, control), x of shape (n,).

        Constrained unknowns start from their values in x. If `setting.fading` is True, the unbalanced forces there
        decrease to 0 as the control goes to 1.
        """

    def restore(self, state: ProblemState) -> None:
        """Restore the step data and history variables of an accepted state, to start a step from it."""

    def state_context(self, state: ProblemState) -> AbstractContextManager[Equations]:
        """Return a context in which the problem has the unknowns, step data and history variables of a state."""
