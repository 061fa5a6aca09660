"""Homogeneous deformations F = diag(l1, l2, l3) of a strain energy, evaluated at many principal stretches at once.

UFL differentiates the energy once, and numpy evaluates the derivatives, so a fit of constants needs no compilation.
"""

import functools
import operator
from collections.abc import Callable
from typing import Any, NamedTuple

import basix.ufl
import numpy as np
import ufl
from ufl import classes
from ufl.algorithms import expand_derivatives, expand_indices
from ufl.corealg.traversal import unique_post_traversal

from ..errors import InputError

MODES = {"uniaxial": -0.5, "pure_shear": 0.0, "equibiaxial": 1.0}
"""Homogeneous tests, {name: k}: the stretches are l, l^k and l^(-1-k), and the third direction is stress-free."""


_DOMAIN = ufl.Mesh(basix.ufl.element("Lagrange", "triangle", 1, shape=(2,)))
_STRETCHES = [ufl.variable(ufl.Constant(_DOMAIN)) for _ in range(3)]
_CONSTANTS: list[Any] = []                     # as many as the energy with the most constants needs


class Response:
    """First and second derivatives of a strain energy with respect to the principal stretches.

    Args:
        energy: function of (F, **constants), F of shape (3, 3), that returns the energy W as a UFL scalar.
        names: names of the constants; the methods take their values in this order.

    Raises:
        InputError: the energy is not a scalar.
    """

    def __init__(self, energy: Callable, names: Any):
        while len(_CONSTANTS) < len(names):
            _CONSTANTS.append(ufl.Constant(_DOMAIN))
        l = _STRETCHES
        F = ufl.as_tensor([[l[0], 0, 0], [0, l[1], 0], [0, 0, l[2]]])
        W = ufl.as_ufl(energy(F, **dict(zip(names, _CONSTANTS))))
        if W.ufl_shape != ():
            raise InputError(f"a strain energy must be a scalar, this one has the shape {W.ufl_shape}")
        # without names of indices, the energies of two materials of a kind are equal
        self._first, self._all = _programs(expand_indices(expand_derivatives(W)), len(names))

    @np.errstate(all="ignore")
    def stress(self, stretches: Any, constants: Any) -> np.ndarray:
        r"""Return the nominal stresses of an incompressible sheet that is stress-free in direction 3.

        The condition in direction 3 eliminates the pressure. With the strain energy W

        .. math:: P_i = \frac{\partial W}{\partial l_i} - \frac{l_3}{l_i} \frac{\partial W}{\partial l_3}

        Args:
            stretches: principal stretches (l1, l2), shape (2, n); l3 = 1/(l1 l2).
            constants: values of the constants of the energy, in the order of the class argument `names`, each a number
                or an array of shape (n,).

        Returns:
            Stresses P in directions 1 and 2, shape (2, n), stress.
        """
        l = _three(stretches)
        g = self._first(l, constants)
        return g[:2] - l[2] / l[:2] * g[2]

    def derivatives(self, stretches: Any, constants: Any) -> tuple[np.ndarray, np.ndarray]:
        r"""Return the derivatives of the strain energy W with respect to three independent principal stretches.

        .. math:: W_{,i} = \frac{\partial W}{\partial l_i}, \qquad
                  W_{,ij} = \frac{\partial^2 W}{\partial l_i \, \partial l_j}

        Args:
            stretches: principal stretches (l1, l2, l3), shape (3, n).
            constants: values of the constants of the energy, in the order of the class argument `names`, each a number
                or an array of shape (n,).

        Returns:
            First derivatives, shape (3, n), and second derivatives, shape (3, 3, n), stress.
        """
        values = self._all(np.asarray(stretches, float), constants)
        return values[:3], values[3:][[[0, 1, 2], [1, 3, 4], [2, 4, 5]]]

    @np.errstate(all="ignore")
    def logarithmic(self, stretches: Any, constants: Any) -> tuple[np.ndarray, np.ndarray]:
        r"""Return gradient and Hessian of the strain energy W in two logarithmic strains, at constant volume.

        .. math:: g_i = \frac{\partial W}{\partial \ln l_i} = \tau_i - \tau_3, \qquad
                  K_{ij} = \frac{\partial^2 W}{\partial \ln l_i \, \partial \ln l_j}, \qquad i, j = 1, 2

        Here :math:`\tau_i` are the principal Kirchhoff stresses.

        Args:
            stretches: principal stretches (l1, l2), shape (2, n); l3 = 1/(l1 l2).
            constants: values of the constants of the energy, in the order of the class argument `names`, each a number
                or an array of shape (n,).

        Returns:
            Gradient g, shape (2, n), and Hessian K, shape (2, 2, n), stress.
        """
        l = _three(stretches)
        g, h = self.derivatives(l, constants)
        tau = l * g
        K = l[:, None] * l * h + np.eye(3)[..., None] * tau
        to_3 = np.array([[1.0, 0, -1], [0, 1, -1]])
        return to_3 @ tau, np.einsum("ai,ijn,bj->abn", to_3, K, to_3)


def in_plane_stretches(mode: str, stretches: Any) -> np.ndarray:
    """Return l and l^k, (2, n), for l (n,): k = -1/2 ("uniaxial"), 0 ("pure_shear") or 1 ("equibiaxial")."""
    l = np.asarray(stretches, float)
    return np.stack([l, l ** MODES[mode]])


def _three(stretches: Any) -> np.ndarray:
    """Return (l1, l2, 1/(l1 l2)), shape (3, n), for the stretches (l1, l2) of an incompressible material."""
    l1, l2 = np.asarray(stretches, float)
    return np.stack([l1, l2, 1 / (l1 * l2)])


class MaterialStability(NamedTuple):
    r"""Ranges of stretch in which a material is stable in uniaxial tension, pure shear and equibiaxial tension.

    Two criteria are examined. With the stretch l, the nominal stress P and the Kirchhoff stress tau they are

    .. math:: \frac{dP}{dl} > 0 \text{ (load)}, \qquad d\tau : d \ln l > 0 \text{ (Drucker)}

    Each range contains l = 1 and is a tuple (lowest, highest).

    Attributes:
        stretches: the examined range.
        finite: {test, such as "uniaxial": range in which the stress is finite}.
        load: {test: range in which the force increases with the stretch}.
        drucker: {test: range in which Drucker's criterion holds}.
    """

    stretches: tuple[float, float]
    finite: dict[str, tuple[float, float]]
    load: dict[str, tuple[float, float]]
    drucker: dict[str, tuple[float, float]]

    @property
    def stable(self) -> bool:
        """True if the load criterion and Drucker's criterion hold in the whole examined range in every test."""
        return all(part == self.stretches for parts in (self.load, self.drucker) for part in parts.values())

    def __str__(self) -> str:
        low, high = self.stretches
        if self.stable:
            return f"stable at stretches from {low:g} to {high:g} in {', '.join(self.load)} tension"
        bounds: dict[tuple, list[str]] = {}
        for what, parts in (("the stress is finite", self.finite), ("the force rises", self.load),
                            ("Drucker's criterion holds", self.drucker)):
            for mode, part in parts.items():
                if part != self.stretches:
                    bounds.setdefault((mode, *part), []).append(what)
        return "; ".join(f"{mode}: {', '.join(what)} only at stretches from {a:.5g} to {b:.5g}"
                         for (mode, a, b), what in bounds.items())


def stability(response: Response, constants: Any, low: float, high: float) -> MaterialStability:
    """Return the ranges of stretch around 1 in which a material is stable in three homogeneous tests.

    The criteria are a finite stress, an increasing force and Drucker's. Ends are searched for at 400 stretches of equal
    ratio from `low` to `high`, then by bisection. Constants have the order of `response`.
    """
    constants = list(constants)

    @np.errstate(all="ignore")
    def margins(mode: str, l: np.ndarray) -> np.ndarray:
        """Return the margins of three criteria, positive where they hold, at stretches l of a test, shape (3, n).

        The first is 1 where the stress is finite, else not a number. The second is l^2 dP/dl, the third the smaller
        eigenvalue of the Hessian of W in the logarithmic strains. Both are divided by the size of Hessian and stress.
        """
        tau, K = response.logarithmic(in_plane_stretches(mode, l), constants)
        size = np.abs(K).max((0, 1)) + np.abs(tau).max(0)
        slope = K[0, 0] + MODES[mode] * K[0, 1] - tau[0]
        smaller = (K[0, 0] + K[1, 1]) / 2 - np.hypot((K[0, 0] - K[1, 1]) / 2, K[0, 1])
        return np.stack([size, slope, smaller]) / size

    def end(mode: str, criterion: int, far: float) -> float:
        def holds(l: np.ndarray) -> np.ndarray:
            return margins(mode, l)[criterion] > -1e-14       # round-off; not a number counts as unstable
        l = np.geomspace(1, far, 400)
        bad = np.flatnonzero(~holds(l))
        if not len(bad):
            return far
        a, b = l[max(bad[0] - 1, 0)], l[bad[0]]
        for _ in range(50):
            middle = (a + b) / 2
            a, b = (middle, b) if holds(np.array([middle]))[0] else (a, middle)
        return float(a)

    parts = [{mode: (end(mode, criterion, low), end(mode, criterion, high)) for mode in MODES}
             for criterion in range(3)]
    return MaterialStability((low, high), *parts)


class _Program:
    """UFL expressions of three stretches and constants as numpy operations; common parts are evaluated once."""

    def __init__(self, inputs: list, outputs: list):
        place: dict[Any, int] = {c: i for i, c in enumerate(inputs)}
        self._steps: list[tuple[Callable, list[int]]] = []
        for output in outputs:
            for node in unique_post_traversal(output):
                if node in place or isinstance(node, (classes.MultiIndex, classes.Label)):
                    continue
                if isinstance(node, classes.Variable):
                    place[node] = place[node.ufl_operands[0]]
                    continue
                self._steps.append((_operation(node), [place[x] for x in node.ufl_operands]))
                place[node] = len(inputs) + len(self._steps) - 1
        self._outputs = [place[x] for x in outputs]

    @np.errstate(all="ignore")
    def __call__(self, stretches: np.ndarray, constants: Any) -> np.ndarray:
        """Return the values (outputs, n) at stretches (3, n), with constants as numbers or of shape (n,)."""
        values = [*stretches, *constants]
        for operation, operands in self._steps:
            values.append(operation(*[values[i] for i in operands]))
        return np.stack([np.broadcast_to(values[i], stretches.shape[1:]) for i in self._outputs]).astype(float)


@functools.lru_cache
def _programs(W: Any, n: int) -> tuple[_Program, _Program]:
    """Return programs of the first, and of the first and second derivatives of W by principal stretches.

    They have 3 and 9 outputs (11, 12, 13, 22, 23, 33 last). W depends on `_STRETCHES` and n `_CONSTANTS`.
    """
    inputs = [*(x.ufl_operands[0] for x in _STRETCHES), *_CONSTANTS[:n]]
    first = [expand_derivatives(ufl.diff(W, x)) for x in _STRETCHES]
    second = [expand_derivatives(ufl.diff(first[i], _STRETCHES[j])) for i in range(3) for j in range(i, 3)]
    return _Program(inputs, first), _Program(inputs, first + second)


_OPERATIONS: dict[type, Callable] = {
    classes.Sum: operator.add, classes.Product: operator.mul, classes.Division: operator.truediv,
    classes.Power: np.float_power, classes.Abs: np.abs, classes.Conditional: np.where, classes.LT: operator.lt,
    classes.LE: operator.le, classes.GT: operator.gt, classes.GE: operator.ge, classes.EQ: operator.eq,
    classes.NE: operator.ne, classes.AndCondition: np.logical_and, classes.OrCondition: np.logical_or,
    classes.NotCondition: np.logical_not, classes.MinValue: np.minimum, classes.MaxValue: np.maximum,
    classes.Sqrt: np.sqrt, classes.Exp: np.exp, classes.Ln: np.log, classes.Cos: np.cos, classes.Sin: np.sin,
    classes.Tan: np.tan, classes.Cosh: np.cosh, classes.Sinh: np.sinh, classes.Tanh: np.tanh, classes.Acos: np.arccos,
    classes.Asin: np.arcsin, classes.Atan: np.arctan, classes.Atan2: np.arctan2, classes.Conj: operator.pos,
    classes.Real: operator.pos,
}


def _operation(node: Any) -> Callable:
    """Return the NumPy function that evaluates a node of a UFL expression from the values of its operands."""
    if isinstance(node, classes.Zero):
        return lambda: 0.0
    if isinstance(node, classes.ScalarValue):
        value = float(node)
        return lambda: value
    if type(node) not in _OPERATIONS:
        raise InputError(f"the strain energy contains {type(node).__name__} ({str(node)[:60]}), which is not a function"
                         f" of F and the constants that formingx can evaluate")
    return _OPERATIONS[type(node)]
