"""Supports, defined by the displacement components that they constrain, or by an energy."""

from __future__ import annotations

from typing import Any, NamedTuple

from ..errors import InputError, check_type, finite
from .part import ScenePart

R, Z = 0, 1
NAMES = ("r", "z", "y", "x")
"""Names of displacement components by the number that a constraint uses; in three dimensions "r" stands for "x"."""


class Constrained(NamedTuple):
    """Constraint of one displacement component to 0, at all nodes of a boundary or at one node.

    Attributes:
        component: number of the displacement component: 0 for r, 1 for z, 2 for y, 3 for x. A body in three dimensions
            has no r: there 0 also means x.
        on: name of the boundary, or None.
        point: reference position of the node, (r, z), length, or None.
        driven: True if the component has a prescribed value, a load parameter (control) of the run, instead of 0.
    """

    component: int
    on: str | None = None
    point: tuple[float, float] | None = None
    driven: bool = False


class ConstrainedMean(NamedTuple):
    r"""Constraint of the mean of one displacement component over a boundary to 0, by a Lagrange multiplier.

    .. math:: \int_{\Gamma} w \, u_i \, dA = 0

    The weight w is 1 or the shear modulus of the layer. The multiplier is a traction in proportion to w.

    Attributes:
        component: number i of the displacement component: 0 for r, 1 for z, 2 for y, 3 for x.
        on: name of the boundary.
        by_stiffness: True if w is the shear modulus of the layer, False if w = 1.
        point: None; `Constrained` has the same attribute.
        driven: False; `Constrained` has the same attribute.
    """

    component: int
    on: str
    by_stiffness: bool = False
    point: None = None
    driven: bool = False


class Support(ScenePart):
    """Base class of supports, also of user-defined ones; a subclass defines `constraints`, `stored_energy`, or both.

    Args:
        on: name of the supported boundary.

    Attributes:
        resists: names of the components, "r" or "z", in which an elastic support resists a rigid translation of its
            boundary.
    """

    resists: tuple[str, ...] = ()

    def __init__(self, on: str):
        self.on = check_type(f"{type(self).__name__}: on", on, str, "the name of a boundary")

    def stored_energy(self, body: Any) -> Any:
        """Return the energy of an elastic support, whose derivative by the displacement enters the residual.

        In a stage in which the support is inactive the energy is 0.

        Args:
            body: a `formingx.forms.loaded_body.LoadedBody`. It has the displacement `u`, the reference position `X`,
                the deformation gradient `F`, and integrals by `integral` and `face`.

        Returns:
            UFL form of rank 0 (stress length^3, per unit depth stress length^2); None if the support has no energy.
        """
        return None

    def all_constraints(self) -> list[Constrained | ConstrainedMean]:
        """Return `constraints`, and one for each component in `resists`, for the check for rigid motions."""
        resisted = (Constrained(_component(f"{self!r}: resists", c), on=self.on) for c in self.resists)
        return [*self.constraints(), *resisted]

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.on!r})"


class _OneComponent(Support):
    """Support that prescribes one displacement component of a boundary; `value` is the name of the component."""

    described = ("component",)

    def __init__(self, on: str, name: str, value: str):
        super().__init__(on)
        self.component = _component(f"{type(self).__name__}({on!r}): {name}", value)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.on!r}, {NAMES[self.component]!r})"


class Symmetry(_OneComponent):
    """Axis or plane of symmetry: the displacement normal to the boundary is 0, the boundary slides freely along it.

    If the boundary is a flat end of the body, the part continues behind it as the mirror image of the body. Results
    then belong to the whole part, see `Scene.symmetry_factor`. The axis of an axisymmetric body is no such end.

    Args:
        on: name of the boundary.
        normal: constrained component: "r" for an axis or a plane along Z, "z" for a plane along R; in three dimensions
            "x", "y" or "z".
        mirror: True: the stability analysis includes modes that are antisymmetric about the plane, see
            `Path.stability`.
        guide: True: the part ends at a frictionless wall along which it slides, so results belong to the body alone.

    >>> [fx.Symmetry("axis"), fx.Symmetry("middle", normal="z", mirror=True)]
    [Symmetry('axis', 'r'), Symmetry('middle', 'z')]
    """

    guide = False

    def __init__(self, on: str, normal: str = "r", mirror: bool = False, guide: bool = False):
        super().__init__(on, "normal", normal)
        self.mirror = check_type(f"Symmetry({on!r}): mirror", mirror, bool, "True or False")
        if check_type(f"Symmetry({on!r}): guide", guide, bool, "True or False"):
            if mirror:
                raise InputError(f"Symmetry({on!r}): mirror = True, guide = True: must be one of them: behind a mirror"
                                 " the body goes on, at a guide it ends")
            self.guide = True

    def constraints(self):
        return [Constrained(self.component, on=self.on)]


class Clamped(Support):
    """Clamped boundary: all displacement components are 0.

    The stress at the corner of a clamped rim is singular: docs/validation.md gives the resulting uncertainty of a limit
    pressure.

    Args:
        on: name of the boundary.

    >>> [(c.component, c.on) for c in fx.Clamped("rim").constraints()]          # u_r and u_z
    [(0, 'rim'), (1, 'rim')]
    """

    holds_rotation = True

    def constraints(self):
        return [Constrained(R, on=self.on), Constrained(Z, on=self.on)]


class SimplySupported(Support):
    r"""Hinge: the mean displacement of a rim face is 0, while the face rotates and thins freely.

    .. math:: \int_{\Gamma} w \, u \, dA = 0

    A support of a single node would be a point support, which has no limit under mesh refinement.

    Args:
        on: name of the boundary.
        weight: weight w of the mean. "area": w = 1, every layer carries the same traction. "stiffness": w is the shear
            modulus of the layer, and tractions are proportional to it. Soft layers may need this if they cannot carry
            the traction of the others.

    >>> scene.supports
    [Symmetry('axis', 'r'), SimplySupported('rim')]
    """

    on: str

    def __init__(self, on: str, weight: str = "area"):
        super().__init__(on)
        if not isinstance(weight, str) or weight not in ("area", "stiffness"):
            raise InputError(f"SimplySupported({on!r}): weight = {weight!r}: must be 'area' or 'stiffness'")
        self.weight = weight

    def constraints(self):
        return [ConstrainedMean(component, self.on, self.weight == "stiffness") for component in (R, Z)]


class PinnedNode(Support):
    """Node with a displacement of 0: the hinge of the coarse grids of Song (1993).

    In a solid it is a point support: results drift with mesh refinement. Prefer `SimplySupported`.

    Args:
        r: reference radius of the node, length.
        z: reference height of the node, length.

    >>> fx.PinnedNode(10.0, 0.15)
    PinnedNode(10.0, 0.15)
    """

    def __init__(self, r: float, z: float):
        self.point = (finite("PinnedNode: r", r), finite("PinnedNode: z", z))

    def constraints(self):
        return [Constrained(R, point=self.point), Constrained(Z, point=self.point)]

    def __repr__(self) -> str:
        return f"PinnedNode({self.point[0]!r}, {self.point[1]!r})"


class PrescribedDisplacement(_OneComponent):
    """Prescribed displacement of a boundary along one axis; its value is a load parameter (control) of the run.

    Args:
        on: name of the boundary.
        component: "r" or "z"; in three dimensions "x", "y" or "z".
        name: name of the support in the stages of a `Process` and in the column names of results.

    >>> pulled = fx.Scene(mesh=sheet, materials=fx.NeoHookean(c10=0.4),
    ...                   supports=[fx.Symmetry("axis"), fx.PinnedNode(0.0, 0.0),
    ...                             fx.PrescribedDisplacement("rim", "r")])
    >>> round(float(fx.solve(pulled, to=10.0)["pole_stretch"][-1]), 3)                  # to twice its width
    2.0
    """

    driven = True
    quantity = "travel"

    def __init__(self, on: str, component: str = "z", name: str | None = None):
        super().__init__(on, "component", component)
        self.name = name

    def constraints(self):
        return [Constrained(self.component, on=self.on, driven=True)]


def _component(name: str, value: str) -> int:
    """Return 0 for "r", 1 for "z", 2 for "y", 3 for "x"; another component is an InputError with `name`."""
    if not isinstance(value, str) or value not in NAMES:
        raise InputError(f"{name} = {value!r}: must be 'r' or 'z' (in three dimensions 'x', 'y' or 'z')")
    return NAMES.index(value)
