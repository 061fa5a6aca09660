"""Interfaces through which the solver sees a problem, F(x, control) = 0; it uses nothing else.

In all members x is the vector of unknowns, and the control a number; both are dimensionless. The rows of x are
distributed over the ranks; an array holds the locally owned entries, shape (n,). `out` is a vector that receives the
result. The calls of a step, in order:

    limit.length, limit.prepare         Limit the step length. Prepare the contacts.
    begin                               Start Newton's method at the predicted state.
    residual                            Compute F. This and the next two lines: in each iteration.
    linearise                           Compute F and its active set for the linearisation.
    tangent, control_derivative         Compute dF/dx and dF/dcontrol, at the (x, control) of the residual.
    folded, limit.check, step_error     Check the state.
    advance                             Accept the state and update the history variables.
    tangent(ahead=True)                 Compute the tangent of the next step, which differs if F has a kink.

`state_context` and `restore` return to another state. `enter` changes the step data between the stages of a process.
The defaults here suit equations without contact, history, time or units. A class derived from `Equations` then only
defines F.
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

from ..contact.step_limit import StepLimit
from ..forms.history import ConstitutiveHistory
from ..forms.schedule import StepData

Array: TypeAlias = npt.NDArray[Any]

Constraint = Callable[[PETSc.Vec, float, PETSc.Vec], tuple[float, float]]
"""c(x, control, gradient) -> (c, dc/dcontrol), having put dc/dx into `gradient`: zero where it holds."""


class Measure(Protocol):
    """A number of every state. size: its unit, in the user's units, of which 1e-12 is negligible."""

    size: float

    def value(self, x: PETSc.Vec, control: float) -> float:
        """Return the value at a state, in the user's units."""

    def equation(self, target: float) -> Constraint:
        """Return the constraint measure = target."""


class Standing(Protocol):
    """A state of a problem.

    Attributes:
        x: the unknowns, locally owned entries, shape (n,).
        control: the control.
        time: process time.
        memory: the history variables from here on.
        setting: plain data of a `StepData`, or empty.
    """

    x: Array
    control: float
    time: float
    memory: list[Any]
    setting: dict[str, Any]


class Tractions(Protocol):
    """Tractions of the contact law at n points in c components.

    Attributes:
        force: shape (n, c), stress.
        sense: sense of sliding, shape (n,).
        stiffness: derivative of the force by the position, shape (n, c, c), stress/length.
        status: `ContactStatus` of each point, shape (n,).
    """

    force: Array
    sense: Array

    @property
    def stiffness(self) -> Array: ...

    @property
    def status(self) -> Array: ...


class Increment(Protocol):
    """Newton's method at n locally owned points of a face in contact, as the iteration that was linearised last sees
    them."""

    @property
    def ramp(self) -> float:
        """Half-width of the distances over which contact begins, length."""

    @property
    def status(self) -> Array:
        """Status of the points: hashable as bytes, shape (n,)."""

    @property
    def arrivals(self) -> Array:
        """Mask of points that touch now but did not where Newton's method began, shape (n,)."""

    def taken(self, points: Array) -> tuple[Array, Array]:
        """Return the forces and stiffnesses that `linearise` has taken, of some points, shapes (m, c), (m, c, c)."""

    def foretold(self, by: Array) -> Tractions:
        """Return the law at the points after a motion, shape (n, c), length."""

    def ahead(self, points: Array | slice) -> Callable[[Array], Tractions]:
        """Return a function that maps a motion of some of the points to their tractions."""

    def in_ramp(self, points: Array) -> Callable[[Array], tuple[Array, Array]]:
        """Return a function that maps motions of m points to their depth and path in the ramp.

        The depth is relative to the width of the ramp, shape (m,). The path is the vector through the ramp, shape
        (m, c), length; 0 for points that slide, adhere or have no friction.
        """

    def expect(self, points: Array, sense: Array) -> None:
        """Set this sense of sliding in the next iteration for the points in a mask, shape (n,)."""


class ContactFace(Protocol):
    """A face in contact: n locally owned points, and the increment that goes on."""

    points: Array

    @property
    def increment(self) -> Increment:
        """Increment of the present run of Newton's method: another after each `begin`."""

    @property
    def scale(self) -> Array:
        """Factor of the tractions in the forces of F, shape (n,)."""

    def add(self, values: Array, forces: Array) -> None:
        """Add forces at the points, shape (n, c), to locally owned rows of F."""

    def leave_out(self, points: Array) -> None:
        """Keep some points (a mask, shape (n,)) open until another increment begins."""

    def moved(self, dx: Array, step: float) -> Array:
        """Return the motion of the points relative to the tool by a correction of x (locally owned) and the control;
        (n, c), length."""


class Viscosity(Protocol):
    """Forces eta V dx of a body that moves through a viscous stress."""

    def forces(self, change: Array, eta: float) -> Array:
        """eta V dx, locally owned entries, shape (n,)."""

    def add_to(self, tangent: PETSc.Mat, eta: float) -> None:
        """Add eta V to a tangent."""

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""


class Attempt(NamedTuple):
    """End of a failed Newton iteration: x (locally owned) and control, and the last correction of both."""

    x: Array
    control: float
    dx: Array
    dcontrol: float


class Examined(Protocol):
    """Examination of a failed attempt: `facts` are fields of a `Diagnosis`."""

    facts: dict[str, Any]

    def draw(self, file: str | PathLike[str], title: str) -> None:
        """Draw the last good state (on rank 0).

        Raises:
            InputError: there is nothing to draw.
        """


class Residual(Protocol):
    """F and its derivatives.

    Attributes:
        comm: communicator.
        x: vector of unknowns; inside `state_context` it holds the state.
        matrix: tangent, refilled by `tangent`.
        force_scale: norm of the forces that balance in the residual last computed.
    """

    comm: MPI.Intracomm
    x: PETSc.Vec
    matrix: PETSc.Mat
    force_scale: float

    @property
    def symmetric(self) -> bool:
        """True if dF/dx is symmetric."""
        return False

    def residual(self, x: PETSc.Vec, control: float, out: PETSc.Vec) -> None:
        """out = F(x, control); sets `force_scale`."""

    def tangent(self, x: PETSc.Vec, control: float, ahead: bool = False) -> PETSc.Mat:
        """Compute dF/dx in `matrix`, and return it.

        Args:
            ahead: True for the derivative towards the next step, where F has a kink at an accepted state.
        """

    def control_derivative(self, x: PETSc.Vec, control: float, out: PETSc.Vec, ahead: bool = False) -> None:
        """out = dF/dcontrol; `ahead`: see `tangent`."""

    def inner(self, a: PETSc.Vec, b: PETSc.Vec) -> float:
        """Product of two changes of x in a metric that knows neither mesh nor units: it measures arc length."""

    def metric_times(self, a: PETSc.Vec, out: PETSc.Vec) -> None:
        """out with inner(a, b) = out . b."""

    def folded(self, x: PETSc.Vec, control: float) -> bool:
        """Return True if (x, control) is no state though F may vanish there: an element is inside out."""
        return False

    def viscosity(self) -> Viscosity:
        """Return the viscosity of a snap-through; the caller destroys it."""

    @property
    def slack_at_rest(self) -> bool:
        """True if dF/dx is singular in the reference configuration, x = 0."""
        return False

    def stiff_state(self, out: PETSc.Vec) -> None:
        """out = a state near rest where dF/dx is regular, for the first direction of a path."""

    def motion(self, control: float) -> Array:
        """Unloaded state with the constraints of a control, the first guess from there; locally owned entries."""
        return np.zeros(self.x.getLocalSize())


class ActiveSet(Protocol):
    """Kinks of F, by contact, and how Newton's method deals with them."""

    @property
    def has_kinks(self) -> bool:
        """True if the tangent ahead of a state may differ from that behind it."""
        return False

    @property
    def present(self) -> Sequence[ContactFace]:
        """The faces in contact that take part now."""
        return []

    @property
    def active_set(self) -> Hashable:
        """Status of all points at the residual last computed, the same on all ranks; None: there are none."""
        return None

    @property
    def held(self) -> Array:
        """Local numbers of the locally owned unknowns that are constrained."""
        return np.zeros(0, dtype=np.int32)

    @property
    def limit(self) -> StepLimit | None:
        """Limits of a step; None: there are none."""
        return None

    def begin(self, old: Standing | None = None) -> None:
        """Prepare the contacts for Newton's method from a guess ahead of a state (None: of no state)."""

    def linearise(self, x: PETSc.Vec, control: float, F: PETSc.Vec) -> None:
        """Prepare an iteration: linearise the contacts, and adapt the residual F at (x, control), in place."""

    def changes_ahead(self, x: PETSc.Vec, control: float) -> list[Array]:
        """Return for each face the stiffness `ahead` less that in the last tangent, shape (n, c, c), stress/length."""
        return []


class Histories(Protocol):
    """History variables: arguments of F besides x and control, and time.

    Attributes:
        memory: the history variables of the last accepted state.
        clock: process time at control 0.
    """

    memory: list[Any]
    clock: float

    @property
    def has_history(self) -> bool:
        """True if F depends on the states before."""
        return False

    @property
    def materials(self) -> Sequence[ConstitutiveHistory]:
        """Histories of the materials of a body."""
        return []

    @property
    def body_has_history(self) -> bool:
        """True if F depends on the states before by more than contact."""
        return False

    @property
    def relaxes(self) -> bool:
        """True if F depends on time."""
        return False

    def advance(self, x: Array, control: float) -> None:
        """Update the history variables to an accepted state."""

    def time_at(self, control: float) -> float:
        """Process time at a control."""
        return self.clock

    def step_error(self, past: Sequence[Standing], share: Array, x: Array,
                   control: float) -> tuple[float, float]:
        """Estimate the time integration error of a step.

        Args:
            past: k accepted states; the step begins at the last of them.
            share: weights of `past` and of x that give the displacement halfway in time, shape (k + 1,).
            x: unknowns at the end of the step.
            control: control at the end of the step.

        Returns:
            Relative error at the end of the step, and the part that persists after another step of this length.
        """
        return 0.0, 0.0


class Stages(Protocol):
    """Step data between two changes of the problem."""

    @property
    def setting(self) -> StepData:
        """Step data: amplitudes of the controls, and inactive items."""

    def enter(self, setting: StepData, x: Array, control: float) -> None:
        """Set the step data: the equations then have (x, control) on their path.

        Constrained unknowns keep their values in x; driven ones have these values at this control. Fading removes the
        unbalanced forces at (x, control).
        """

    def restore(self, state: Standing) -> None:
        """Restore the stage data and history variables of an accepted state, to start a step from it."""

    def state_context(self, state: Standing) -> AbstractContextManager[Equations]:
        """Return a context in which the problem, with its x and control, is at a state."""

    def bring_in(self, number: int, x: Array, control: float) -> None:
        """Activate an item (its number in the step data) without history.

        Raises:
            InputError: a tool would be activated inside the body.
        """


class Units(Protocol):
    """Meaning of the dimensionless numbers."""

    @property
    def scales(self) -> Sequence[float]:
        """The user's value over the amplitude of each item that a `StepData` counts; last, 1.0 for the time."""

    @property
    def units(self) -> tuple[float, float]:
        """Unit of the dimensionless energy and unit of the dimensionless length, in the user's units."""
        return 1.0, 1.0

    @property
    def drives(self) -> str | None:
        """Kind of the control: "pressure", "travel", "time" or, if it is none of them, None."""
        return None

    @property
    def fixed_loads(self) -> list[str]:
        """Loads that act already before anything is controlled, as text."""
        return []

    @property
    def main_columns(self) -> Sequence[str]:
        """The measures that tell one state from another in a line."""
        return []

    def shown(self, control: float) -> tuple[str, float]:
        """Return the name of the controlled quantity and its value in the user's units."""
        return "control", control

    def absurd(self, control: float) -> str | None:
        """Return the reason for which no process reaches a control, as text, or None."""
        return None

    @property
    def why_not_finite(self) -> str:
        """Reason for which a residual is infinite or not a number."""
        return "the equations are not defined there"

    def examine(self, last: Standing | None, attempt: Attempt | None) -> Examined | None:
        """Examine the last good state and a failed attempt, for a `Diagnosis`; collective."""
        return None


class Equations(Residual, ActiveSet, Histories, Stages, Units, Protocol):
    """All that the solver sees."""
