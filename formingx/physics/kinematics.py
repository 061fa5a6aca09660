"""Total Lagrangian kinematics of a meridional plane, a cross-section, or a sheet in three dimensions.

A section has reference coordinates X = (R, Z) and the displacement u = (u_r, u_z), in the mesh's unit of length. The
factor 2 pi R of axisymmetric integrals appears in this module only.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import ufl
from ufl.constantvalue import Zero
from ufl.tensors import ListTensor

from ..errors import InputError
from ..mesh.nodes import COORDINATES
from .supports import NAMES, Constrained

BLOCK = ((0, 0), (0, 1), (1, 0), (1, 1), (2, 2))
"""Nonzero entries of F of a section: in its plane, and in the hoop direction or along the depth."""


class Kinematics:
    """Base class of the kinematics of a body: coordinates, deformation gradient, area vectors and rigid motions.

    Attributes:
        axes: names of the components of a displacement.
        components: number of components of a displacement, and of a deformed position.
        coordinates: number of coordinates of a reference point, which tables and functions of the position take.
        axisymmetric: True if the body is the section rotated about the axis R = 0.
        dimension_of_volume: power of the length in a volume: 3, or 2 per unit depth.
        formulation: subclass of `formingx.forms.formulation.Formulation` with the variational forms of the body; None:
            the class that belongs to the model (solid or membrane).
        reader: class that evaluates results of a path; None: the class for a section.
        scene_checks: module with the checks of the model declaration (`Scene`); None: the checks for a section.
    """

    axes: tuple[str, ...] = ("r", "z")
    components = 2
    coordinates = COORDINATES
    axisymmetric = False
    dimension_of_volume = 3
    formulation: Any = None
    reader: Any = None
    scene_checks: Any = None

    def in_axes(self, support: Any, items: list[Any]) -> list[Any]:
        """Return constraints whose components 0 to 3 (r, z, y, x) are renumbered by their places in `axes`.

        Raise `InputError` if the body does not have a constrained component.
        """
        for item in items:
            if NAMES[item.component] not in self.axes:
                raise InputError(f"{support!r}: a section has no component {NAMES[item.component]!r}: must be 'r' or"
                                 f" 'z'")
        return items

    def deformation_gradient(self, u: Any, X: Any) -> Any:
        """Return the deformation gradient F of a displacement; each subclass defines it.

        Args:
            u: displacement (UFL, shape (2,), length).
            X: reference position (UFL, shape (2,), length).

        Returns:
            F (UFL, shape (3, 3)).
        """
        raise NotImplementedError

    def weight(self, X: Any) -> Any:
        r"""Return the reference volume per area of the section, equal to the reference area per length of a line in it.

        .. math:: w = 2 \pi R \text{ (axisymmetric)}, \qquad w = 1 \text{ (plane strain, three dimensions)}

        Args:
            X: reference position (UFL or numbers, shape (2,), length; in three dimensions shape (3,)).

        Returns:
            Weight w, length; dimensionless if it is 1.
        """
        raise NotImplementedError

    def area_vector(self, u: Any, X: Any, N: Any) -> Any:
        r"""Return the current area vector per unit length of a reference line, by Nanson's formula.

        .. math:: a = w(X) \, J F^{-T} N = \begin{cases} 2 \pi (R + u_r) \, \mathrm{cof}(I + \nabla u) N &
                  \text{axisymmetric} \\ \mathrm{cof}(I + \nabla u) N & \text{else} \end{cases}

        F is the deformation gradient and J its determinant; w is 2 pi R or 1 (`weight`). For quadratic displacements
        of an axisymmetric body a is a polynomial of degree 3, without division by R. In three dimensions it is the
        area vector per unit reference area of the sheet.

        Args:
            u: displacement (UFL, shape (2,) or (3,), length).
            X: reference position (UFL, shape of u, length).
            N: unit normal of the line in the reference configuration (UFL, shape of u).

        Returns:
            Area vector a (UFL, shape of u), in the unit of w.
        """
        raise NotImplementedError

    def rigid_motions(self) -> dict[str, Callable[[np.ndarray], np.ndarray]]:
        """Return the infinitesimal rigid motions of the body that its symmetry permits.

        Returns:
            {name: function from points, shape (n, 2), to displacements, shape (n, 2)}; in three dimensions (n, 3).
        """
        raise NotImplementedError

    def mode_gradient(self, mode: Any, X: Any, number: Any) -> Any:
        r"""Return the amplitude H of the change of the deformation gradient F by a non-axisymmetric mode.

        .. math:: u_r = U \cos n\theta, \quad u_z = W \cos n\theta, \quad u_\theta = V \sin n\theta

        The entries of H are amplitudes of a sine or a cosine. In plane strain the mode varies along the depth instead,
        as the cosine and sine of k x3. H of an axisymmetric body, and in plane strain, is

        .. math:: \begin{bmatrix} U_{,R} & U_{,Z} & -(n U + V)/R \\ W_{,R} & W_{,Z} & -n W/R \\
                  V_{,R} & V_{,Z} & (n V + U)/R \end{bmatrix}, \qquad
                  \begin{bmatrix} U_{,R} & U_{,Z} & -k U \\ W_{,R} & W_{,Z} & -k W \\ V_{,R} & V_{,Z} & k V
                  \end{bmatrix}

        Args:
            mode: amplitudes (U, W, V) (UFL, shape (3,), length).
            X: reference position (UFL, shape (2,), length).
            number: number n of waves; in plane strain the wave number k along the depth, 1/length.

        Returns:
            H (UFL, shape (3, 3)), components r, z, and hoop or depth.
        """
        raise NotImplementedError

    def rigid_modes(self, number: float) -> list[Callable[[np.ndarray], np.ndarray]]:
        """Return the rigid-body motions of the deformed body that are modes with a given wave number.

        In plane strain these are the motions in the section and the translation along the depth, for the wave number 0.

        Args:
            number: circumferential wave number; in plane strain the wave number along the depth, 1/length.

        Returns:
            Functions from deformed positions, shape (m, 2), to amplitudes along r, z and the hoop or depth direction,
            shape (m, 3). The list is empty if no rigid motion has this wave number.
        """
        raise NotImplementedError


class Axisymmetric(Kinematics):
    r"""Rotational symmetry about R = 0 without twist.

    .. math:: F = \begin{bmatrix} 1 + u_{r,R} & u_{r,Z} & 0 \\ u_{z,R} & 1 + u_{z,Z} & 0 \\ 0 & 0 & 1 + u_r / R
              \end{bmatrix}

    Quadrature points never lie on the axis, so u_r/R needs no guard.

    >>> fx.Axisymmetric().axes, list(fx.Axisymmetric().rigid_motions())                 # what a support must stop
    (('r', 'z'), ['translation along Z'])
    """

    axisymmetric = True

    def deformation_gradient(self, u, X):
        return _block(ufl.Identity(2) + ufl.grad(u), 1 + u[0] / X[0])

    def weight(self, X):
        return 2 * ufl.pi * X[0]

    def area_vector(self, u, X, N):
        return 2 * ufl.pi * (X[0] + u[0]) * _cofactor(ufl.Identity(2) + ufl.grad(u)) * N

    def rigid_motions(self):
        return {"translation along Z": _along_z}

    def mode_gradient(self, mode, X, number):
        U, W, V = mode[0], mode[1], mode[2]
        return _rows(ufl.grad(mode), [-(number * U + V) / X[0], -number * W / X[0], (number * V + U) / X[0]])

    def rigid_modes(self, number):
        r"""Return the motions along and about the axis (n = 0), or the translation and rotation across it (n = 1).

        .. math:: n = 0: \; (0, 1, 0), \; (0, 0, r), \qquad n = 1: \; (1, 0, -1), \; (z, -r, -z)

        Args:
            number: number of waves n.

        Returns:
            Functions from deformed positions (r, z), shape (m, 2), to radial, axial and hoop amplitudes (U, W, V),
            shape (m, 3); empty for other n.
        """
        def mode(*components):
            return lambda x: np.stack([c(x[:, 0], x[:, 1]) for c in components], 1)
        zero, unit = (lambda r, z: 0 * r), (lambda r, z: 1 + 0 * r)
        return {0: [mode(zero, unit, zero), mode(zero, zero, lambda r, z: r)],
                1: [mode(unit, zero, lambda r, z: -1 + 0 * r),
                    mode(lambda r, z: z, lambda r, z: -r, lambda r, z: -z)]}.get(number, [])


class PlaneStrain(Kinematics):
    r"""Plane strain of a long body: forces and volumes are per unit depth.

    .. math:: F = \begin{bmatrix} 1 + u_{r,R} & u_{r,Z} & 0 \\ u_{z,R} & 1 + u_{z,Z} & 0 \\ 0 & 0 & 1 \end{bmatrix}

    >>> fx.PlaneStrain().axes, list(fx.PlaneStrain().rigid_motions())
    (('r', 'z'), ['translation along R', 'translation along Z', 'rotation'])
    """

    dimension_of_volume = 2

    def deformation_gradient(self, u, X):
        return _block(ufl.Identity(2) + ufl.grad(u), 1)

    def weight(self, X):
        return 1

    def area_vector(self, u, X, N):
        return _cofactor(ufl.Identity(2) + ufl.grad(u)) * N

    def rigid_motions(self):
        return {"translation along R": lambda X: np.stack([1 + 0 * X[:, 0], 0 * X[:, 0]], 1),
                "translation along Z": _along_z,
                "rotation": lambda X: np.stack([-X[:, 1], X[:, 0]], 1)}

    def mode_gradient(self, mode, X, number):
        return _rows(ufl.grad(mode), [-number * mode[0], -number * mode[1], number * mode[2]])

    def rigid_modes(self, number):
        plane = [lambda x, f=f: np.column_stack([f(x), 0 * x[:, 0]]) for f in self.rigid_motions().values()]
        return [] if number else [*plane, lambda x: np.column_stack([0 * x, 1 + 0 * x[:, 0]])]


class ThreeD(Kinematics):
    """Sheet in three dimensions: a surface with a thickness, coordinates (x, y, z).

    The gradient of a displacement is the surface gradient, so I + grad u does not stretch the normal of the sheet. Its
    cofactor gives the area vector. `formingx.extensions.space.surface.Surface` adds the stretch through the thickness.

    >>> fx.ThreeD().axes, fx.ThreeD().coordinates                                       # a reference point is (x, y)
    (('x', 'y', 'z'), 2)
    """

    axes = ("x", "y", "z")
    components = 3

    def in_axes(self, support, items):
        """Return constraints with components 0 for x, 1 for y, 2 for z, from 0 r, 1 z, 2 y, 3 x; r also means x.

        A clamp or a hinge constrains all nodes of its rim along x, y and z.
        """
        if {item.component for item in items} == {0, 1}:
            items = [*items, items[0]._replace(component=NAMES.index("y"))]
        return [Constrained(self.axes.index(NAMES[c.component].replace("r", "x")), on=c.on, driven=c.driven)
                for c in items]

    def deformation_gradient(self, u, X):
        return ufl.Identity(3) + ufl.grad(u)

    def weight(self, X):
        return 1

    def area_vector(self, u, X, N):
        return ufl.cofac(self.deformation_gradient(u, X)) * N

    def rigid_motions(self):
        """Return the rigid motions in the plane of the sheet, and the translation normal to it, by name.

        Tension resists the others: a flat sheet on one straight rim counts as supported.
        """
        return {**{f"translation along {a}": lambda X, k=k: 0 * X + np.eye(3)[k] for k, a in enumerate(self.axes)},
                "rotation about z": lambda X: np.stack([-X[:, 1], X[:, 0], 0 * X[:, 0]], 1)}


def _along_z(X):
    """Return the unit displacement (0, 1) at each of n positions X: both arrays have the shape (n, 2)."""
    return np.stack([0 * X[:, 0], 1 + 0 * X[:, 0]], 1)


def volume_ratio(F):
    """Return J = det F (UFL), F of shape (3, 3), without products that vanish for its block structure."""
    J = F[2, 2] * (F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0])
    if is_block(F):
        return J
    return J + F[0, 2] * (F[1, 0] * F[2, 1] - F[1, 1] * F[2, 0]) + F[1, 2] * (F[0, 1] * F[2, 0] - F[0, 0] * F[2, 1])


def is_block(F):
    """Return True if F has no entries 13, 23, 31 and 32, which only non-axisymmetric modes add."""
    across = ((0, 2), (1, 2), (2, 0), (2, 1))
    return not isinstance(F, ListTensor) or all(isinstance(F[place], Zero) for place in across)


def in_section_order(F):
    """Return F (UFL, shape (3, 3)) with the axes 2 and 3 exchanged if axis 2 is separate by construction.

    So it is for laws that depend on the direction in a sheet in three dimensions, whose axis 2 is the normal.
    """
    across = ((0, 1), (1, 2), (1, 0), (2, 1))
    if is_block(F) or not all(isinstance(F[place], Zero) for place in across):
        return F
    return ufl.as_tensor([[F[i, j] for j in (0, 2, 1)] for i in (0, 2, 1)])


def invariants(F):
    """Return I1 = tr C and I2 = (I1^2 - tr C^2)/2 of C = F^T F (UFL scalars), for F of shape (3, 3)."""
    C = F.T * F
    I1 = ufl.tr(C)
    return I1, (I1**2 - ufl.inner(C, C)) / 2


def sum_of_powers(F, alpha):
    r"""Return the sum of powers alpha of the principal stretches of F (UFL), smooth where in-plane ones coincide.

    .. math:: \lambda_1^\alpha + \lambda_2^\alpha + \lambda_3^\alpha

    Let m and d >= 0 be mean and half difference of the in-plane eigenvalues of C, and a = alpha/2. The in-plane part

    .. math:: (m + d)^a + (m - d)^a

    is even in d. Near d = 0 its series in x = (d/m)^2 avoids 0/0 in value and derivatives. Elsewhere the small
    eigenvalue is computed as det C / (m + d), because m - d would lose digits in a thin sheet. At the switch x = 1e-4,
    five terms and round-off both leave second derivatives exact to some 1e-14 of their norm (alpha from -5 to 10). The
    sum includes the entries 13, 23, 31 and 32, which a non-axisymmetric mode adds to F, to second order.
    """
    F = in_section_order(F)
    C = F.T * F
    a = alpha / 2
    m = (C[0, 0] + C[1, 1]) / 2
    x = (((C[0, 0] - C[1, 1]) / 2) ** 2 + C[0, 1] * C[1, 0]) / m**2
    near = ufl.lt(x, 1e-4)
    term, series = 2, 2
    for k in (2, 4, 6, 8):
        term = term * (a - k + 2) * (a - k + 1) / (k * (k - 1)) * x
        series = series + term
    large = 1 + ufl.sqrt(ufl.conditional(near, 1e-4, x))        # the branch not taken must be finite too
    small = _in_plane_determinant(F) / m**2 / large
    powers = m**a * ufl.conditional(near, series, large**a + small**a) + C[2, 2] ** a
    return powers if is_block(F) else powers + _powers_across(F, ufl.as_vector([C[0, 2], C[1, 2]]), a)


def _in_plane_determinant(F):
    """Return the determinant C11 C22 - C12^2 of the in-plane part of C = F^T F."""
    det = (F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]) ** 2
    if is_block(F):
        return det
    return det + sum((F[2, 0] * F[i, 1] - F[2, 1] * F[i, 0]) ** 2 for i in range(2))


def _powers_across(F, b, a):
    r"""Return the terms that the entries b = (C13, C23) add to tr C^a, to second order.

    C is F^T F, A its in-plane part with an eigenvalue x, and c = C33. To second order x becomes x + b^2/(x - c), so the
    terms are

    .. math:: b \cdot g(A) \, b, \qquad g(x) = a \, \frac{x^s - c^s}{x - c}
              = a \, (x c)^{(s - 1)/2} \, \frac{\sinh(s y)}{\sinh y}, \quad s = a - 1, \quad y = \tfrac{1}{2} \ln(x/c)

    The second form loses no digits where stretches coincide. At b = 0 the terms are exact in value and in first and
    second derivatives by F. Eigenvalues of A differ by at least 2e-8 of their mean, which avoids 0/0.
    """
    F2, c, s = ufl.as_matrix([[F[0, 0], F[0, 1]], [F[1, 0], F[1, 1]]]), F[2, 2] ** 2, a - 1
    A = F2.T * F2
    m, J2 = ufl.tr(A) / 2, ufl.det(F2) ** 2
    apart_squared = ((A[0, 0] - A[1, 1]) / 2) ** 2 + A[0, 1] ** 2
    d = ufl.sqrt(ufl.conditional(ufl.lt(apart_squared, 1e-16 * m**2), 1e-16 * m**2, apart_squared))

    def g(x):
        y = ufl.ln(x / c) / 2
        same = ufl.lt(abs(y), 1e-12)
        away = ufl.conditional(same, 1, y)                      # the branch not taken must be finite too
        return a * (x * c) ** ((s - 1) / 2) * ufl.conditional(same, s, ufl.sinh(s * away) / ufl.sinh(away))
    high, low = g(m + d), g(J2 / (m + d))
    apart = ufl.inner(b, (A - m * ufl.Identity(2)) * b) / d
    return (high + low) / 2 * ufl.inner(b, b) + (high - low) / 2 * apart


def cofactor_change(F, H):
    r"""Return the first-order change of the cofactor of F by a change H of F (UFL, shape (3, 3) each).

    .. math:: (\delta \, \mathrm{cof} F)_{ij} = F_{ac} H_{bd} + H_{ac} F_{bd} - F_{ad} H_{bc} - H_{ad} F_{bc}

    Here (i, a, b) and (j, c, d) are cyclic permutations of (1, 2, 3).
    """
    def entry(i, j):
        (a, b), (c, d) = ((i + 1) % 3, (i + 2) % 3), ((j + 1) % 3, (j + 2) % 3)
        return F[a, c] * H[b, d] + H[a, c] * F[b, d] - F[a, d] * H[b, c] - H[a, d] * F[b, c]
    return ufl.as_tensor([[entry(i, j) for j in range(3)] for i in range(3)])


def _rows(gradient, last):
    """Return the tensor (UFL, shape (3, 3)) with the columns 1 and 2 in `gradient`, shape (3, 2), and 3 in `last`."""
    return ufl.as_tensor([[gradient[i, 0], gradient[i, 1], last[i]] for i in range(3)])


def _block(F2, F33):
    """Return the tensor (UFL, shape (3, 3)) with the in-plane block F2, shape (2, 2), and the entry F33, else 0."""
    return ufl.as_tensor([[F2[0, 0], F2[0, 1], 0], [F2[1, 0], F2[1, 1], 0], [0, 0, F33]])


def _cofactor(F2):
    """Return the cofactor of an in-plane tensor F2 (UFL, shape (2, 2))."""
    return ufl.as_tensor([[F2[1, 1], -F2[1, 0]], [-F2[0, 1], F2[0, 0]]])
