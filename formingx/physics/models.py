"""Models of a body: a solid with one of two treatments of incompressibility, or a membrane.

Both treatments derive from the penalty of Song (1993), eq. (3.4.1), here with the shear modulus of the layer as a
factor, which makes epsilon dimensionless. They are equal for small J - 1. `MixedPressure` needs far fewer Newton
iterations, since its stress does not contain the volume error of an iterate times the bulk modulus 8 mu/epsilon. Models
remove the isotropic stress of W in the reference configuration, see `formingx.materials.material`.
"""

from __future__ import annotations

from inspect import signature
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError, check_name, check_type, finite, non_negative, positive
from ..mesh.triangles import Place, Triangles
from ..values.tolerances import LARGE_ERROR, WALL_ERROR

_SLENDER_TRIANGLE = 3.0                                # slenderness of triangles that can do harm


class Locking(NamedTuple):
    """Warning that the element of `MixedPressure(space="P1dg")` locks in slender triangles of a mesh.

    Attributes:
        error: expected relative error of the bending stiffness of the body.
        slenderness: ratio of height to width of the triangle with the largest expected error.
        place: reference position, layer and boundary of this triangle (`Place`).
    """

    error: float
    slenderness: float
    place: Place

    def __str__(self) -> str:
        share = "several" if self.error > LARGE_ERROR else "about one"
        return (f"triangles are up to {self.slenderness:.3g} times taller than wide across the thickness (at"
                f" {self.place}): the default element locks in them, and bending comes out too stiff, by {share} per"
                f" cent: use more elements through the thickness (at most 1.5 times taller than wide), fewer along the"
                f" sheet, or MixedPressure(space='P1')")


class Model:
    """Base class of body models: a membrane, or a solid with one of the treatments of incompressibility.

    Attributes:
        solid: True if the body has bending stiffness and a stress through its thickness.
        volume_stiffness: additional bulk stiffness divided by the shear modulus, see `MixedPressure`.
    """

    solid = True
    volume_stiffness = 0.0

    def __repr__(self) -> str:
        usual = {name: p.default for name, p in signature(type(self)).parameters.items()}
        given = {name: value for name, value in vars(self).items() if name in usual and value != usual[name]}
        return f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in given.items())})"

    def check(self, scene: Any) -> None:
        """Raise `InputError` if the body model excludes a support, contact or material of a scene."""

    def locking(self, mesh: Any) -> Locking | None:
        """Return the warning that elements lock in a mesh, or None, the default; collective."""
        return None


class Membrane(Model):
    r"""Membrane model of a thin sheet: the mid-surface deforms, its reference thickness is given.

    .. math:: \lambda_3 = \frac{1}{\lambda_1 \lambda_2}

    The thickness stretch preserves the volume exactly (Adkins and Rivlin 1952). Layers are bonded and their energies
    add up. A membrane has no stress through its thickness. It has no bending stiffness either, so the rim of a section
    cannot be clamped. A section has no contact with tools as a membrane; a sheet in three dimensions has.

    Args:
        wrinkles: fraction of the stiffness, up to 1, that remains where a sheet in three dimensions wrinkles, for
            example 0.01; None: the full stiffness. `formingx.extensions.space.surface` states the tension-field theory.

    >>> thin = fx.Scene(mesh=sheet, materials=scene.materials, supports=scene.supports, loads=scene.loads,
    ...                 model=fx.Membrane())
    >>> found = fx.trace(thin, until=fx.pole_height(12.0), progress=False)
    >>> round(float(found["pressure"].max() / path["pressure"].max()), 2)
    1.0
    """

    solid = False
    wrinkles: float | None = None

    def __init__(self, wrinkles: float | None = None):
        if wrinkles is not None:
            self.wrinkles = positive("Membrane: wrinkles", wrinkles)
            if self.wrinkles > 1:
                raise InputError(f"Membrane: wrinkles = {wrinkles!r}: must be at most 1")

    def check(self, scene):
        for support in scene.supports:
            if support.holds_rotation and scene.kinematics.components == 2:
                raise InputError(f"Scene: {support!r} with model=Membrane(): a membrane has no bending stiffness, its"
                                 f" rim cannot be clamped; use SimplySupported({support.on!r}), or a solid model")
        if scene.expansion:
            raise InputError("Scene: expansion: a membrane keeps its volume: use a solid model, MixedPressure()")
        if self.wrinkles is not None and scene.kinematics.components == 2:
            raise InputError("Scene: Membrane(wrinkles=...): is for a sheet in three dimensions; a section has no"
                             " wrinkles along the hoop: use a solid model")
        if scene.contacts and scene.kinematics.components == 2:
            raise InputError(f"Scene: {scene.contacts[0]!r}: a membrane has no contact yet: use a solid model,"
                             f" MixedPressure() for one")


class PressureSpace(NamedTuple):
    """Element of the pressure on triangles, and the enrichment of the quadratic displacement that belongs to it.

    Attributes:
        family: family of the pressure element, "Lagrange" or "DG" (discontinuous).
        degree: degree of the pressure element.
        bubble: True if a cubic bubble enriches the P2 displacement.
    """

    family: str
    degree: int
    bubble: bool

    @property
    def continuous(self) -> bool:
        """True if the pressure is continuous within a layer; each layer then needs its own pressure field."""
        return self.family == "Lagrange"


_SPACES = {
    "P0": PressureSpace("DG", 0, bubble=False),
    "P1": PressureSpace("Lagrange", 1, bubble=False),
    "P1dg": PressureSpace("DG", 1, bubble=True),
}


class MixedPressure(Model):
    r"""Solid with the pressure as an unknown: quadratic (P2) displacement and one of three pressure spaces.

    .. math:: W(F) - \sigma_0 \ln J + p (J - 1) - \frac{\epsilon p^2}{16 \mu}

    W is the strain energy of the material, mu its shear modulus, and p the pressure, positive in tension. J is the
    determinant of the deformation gradient F. The stress :math:`\sigma_0` makes the reference configuration free of
    stress, see `formingx.materials.material`. The pressure may jump across the interface of two materials.

    Args:
        eps: dimensionless penalty parameter epsilon; 0 preserves the volume exactly (weakly, in the pressure space).
        space: one of the following pressure spaces.

            - "P1": continuous in each layer (Taylor-Hood).
            - "P0": constant in each element, cheap; displacements converge with order 2 instead of 3. It preserves the
              volume of each element.
            - "P1dg": linear in each element, with a cubic bubble in the displacement (Crouzeix and Raviart 1973). It
              preserves the volume of each element. Triangles must not be slender across a thick sheet: the inf-sup
              constant decreases with width over height, and the element locks (`locking`). A scene with an expected
              error of 5 % is refused.
        volume_stiffness: kappa of an additional energy :math:`\kappa \mu (J - 1)^2/2` at each point, for example 10.
            Pressures preserve the volume of an element, not of its parts. The pressure may vary within an element by
            more than the shear modulus, as in a block pressed very flat. Then one part collapses and another opens. The
            additional energy prevents this; thin sheets on coarse meshes become stiffer. (The grad-div stabilisation of
            mixed methods: Olshanskii and Reusken, Mathematics of Computation 73, 2004.)

    >>> scene.model
    MixedPressure()
    """

    stress_free = True

    def __init__(self, *, eps: float = 0.0, space: str = "P1dg", volume_stiffness: float = 0.0):
        self.eps = non_negative("MixedPressure: eps", eps)
        if self.eps > 1:
            raise InputError(f"MixedPressure: eps = {eps!r}: must be at most 1 (thesis: 2e-2 to 1e-7)")
        check_name("MixedPressure: space", space, _SPACES)
        self.volume_stiffness = non_negative("MixedPressure: volume_stiffness", volume_stiffness)
        self.space, self.pressure = space, _SPACES[space]

    def check(self, scene):
        found = self.locking(scene.mesh)
        if found is not None and found.error > LARGE_ERROR:
            raise InputError(f"Scene: {found}")

    def locking(self, mesh):
        r"""Estimate how much narrow, high triangles through a thick sheet stiffen its bending; collective.

        The height of a triangle is its longest edge, and its width the altitude on this edge. The inf-sup constant of
        "P1dg" decreases as 2 width/height. For hinged sheets 2 to 15 times wider than thick, each triangle causes a
        relative error of the bending stiffness of at most (benchmarks/thickness.py)

        .. math::
            0.3 \, \frac{\text{height}}{\text{width}}
            \left(\frac{\text{height}}{\text{length of the body}}\right)^{2.5}

        Clamped sheets, and blocks that stick between plates, have larger errors. Along a thin sheet slender triangles
        do no harm; where one of them spans the sheet, every pressure space is equally wrong.

        Args:
            mesh: the `Mesh`.

        Returns:
            The warning if the area-weighted mean of this error over all triangles exceeds 0.3 %, else None.
        """
        if not self.pressure.bubble:
            return None
        body = Triangles(mesh)
        across = (body.edge < body.thickness) & (body.slenderness > _SLENDER_TRIANGLE)
        error = np.where(across, 0.3 * body.slenderness * (body.edge / body.length) ** 2.5, 0.0)
        mean, worst = float((error * body.area).sum() / body.area.sum()), int(np.argmax(error))
        return Locking(mean, float(body.slenderness[worst]), body.place(worst)) if mean > WALL_ERROR else None

    def terms(self, J, p, modulus, eps):
        r"""Return [(energy density (UFL, stress), metadata)] of a Lagrange multiplier p with a penalty.

        .. math:: p (J - 1) - \frac{\epsilon p^2}{16 \mu}

        p: positive in tension (stress). modulus: shear modulus mu (stress). eps: not used if the model has eps = 0.
        """
        density = p * (J - 1)
        if self.eps > 0:
            density = density - eps * p**2 / (16 * modulus)
        return [(density, {})]


class DisplacementPenalty(Model):
    r"""Solid with displacement unknowns only; a reduced rule integrates the penalty (Song 1993, section 3.4).

    .. math:: W(F) - \sigma_0 \ln J + \frac{\mu}{\epsilon} (I_3 - 1)^2, \qquad I_3 = J^2

    W is the strain energy of the material, mu its shear modulus and J the determinant of the deformation gradient F.
    The stress :math:`\sigma_0` makes the reference configuration free of stress, see `formingx.materials.material`.

    Args:
        eps: dimensionless penalty parameter epsilon, positive (thesis: 2e-2 to 1e-7).
        points: number of quadrature points of the penalty.

            - 3: interior points, exact to degree 2, the usable rule.
            - 4: exact to degree 3, one weight is negative; the tangent becomes indefinite in bending for eps <= 1e-3.
            - 7: full integration; the elements lock.
        stress_free: False leaves the term with :math:`\sigma_0` out, as printed in (3.4.1). The reference configuration
            then has a stress, and the unloaded body swells or shrinks to I3 - 1 of the order of eps.

    >>> fx.DisplacementPenalty(eps=1e-4)
    DisplacementPenalty(eps=0.0001)
    """

    pressure = None

    def __init__(self, *, eps: float = 1e-3, points: int = 3, stress_free: bool = True):
        self.stress_free = check_type("DisplacementPenalty: stress_free", stress_free, bool, "True or False")
        self.eps = positive("DisplacementPenalty: eps", eps)
        finite("DisplacementPenalty: points", points)
        if points not in _RULES:
            raise InputError(f"DisplacementPenalty: points = {points!r}: must be one of {sorted(_RULES)}")
        self.points = points

    def check(self, scene):
        if scene.expansion:
            raise InputError(f"Scene: expansion: with model={type(self).__name__}(): it takes no field of temperature;"
                             f" use MixedPressure()")
        for layer, material in scene.materials.items():
            if material.varies or material.internal:
                raise InputError(f"Scene: layer {layer!r}: {material} with model={type(self).__name__}(): it takes"
                                 f" no constants that vary over the body, and no histories; use MixedPressure()")

    def terms(self, J, p, modulus, eps):
        r"""Return [(energy density (UFL, stress), metadata)] of the penalty, eq. (3.4.1) of Song (1993).

        .. math:: \frac{\mu}{\epsilon} (I_3 - 1)^2, \qquad I_3 = J^2

        The factor mu, the shear modulus of the layer (stress), makes epsilon dimensionless; (3.4.1) has none.
        """
        rule = _RULES[self.points]
        metadata = {} if rule is None else {
            "quadrature_rule": "custom", "quadrature_points": rule[0], "quadrature_weights": rule[1]}
        return [(modulus / eps * (J**2 - 1) ** 2, metadata)]


_RULES = {
    3: (np.array([[1, 1], [4, 1], [1, 4]]) / 6, np.array([1, 1, 1]) / 6),
    4: (np.array([[1 / 3, 1 / 3], [0.6, 0.2], [0.2, 0.6], [0.2, 0.2]]), np.array([-27, 25, 25, 25]) / 96),
    7: None,
}
