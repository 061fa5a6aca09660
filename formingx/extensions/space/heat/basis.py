r"""Polynomials through the thickness of a sheet: points, weights, conductivity and decay modes of a column.

In each layer the temperature is a polynomial of its values at Gauss-Lobatto points, whose quadrature makes the capacity
matrix diagonal (Patera, J. Comput. Phys. 54 (1984) 468). On a column of thickness h = 1 the equations are

.. math:: C \frac{dT}{dt} = -K T

with insulated faces. Modes v and rates mu satisfy K v = mu C v. In a column of thickness h the rates are mu/h^2, so one
set of modes serves all nodes of a sheet.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

_ORDER, _ORDER_OF_LAYER = 12, 8
"""Degree of the polynomial in the only layer, and in each of several layers.

A face of 150 C that touches steel (Biot number 20) is exact to 2e-3 of the temperature difference at a Fourier number
of 0.001, and to 1.3e-5 at 0.01 (tests/test_heat_columns.py).
"""


class Layer:
    """Points of a column within one layer.

    Attributes:
        points: numbers of the points in the column, a slice of length m.
        weights: quadrature weights of the points, shape (m,); their sum is 1.
        share: thickness of the layer over the thickness of the sheet.
    """

    def __init__(self, first: int, weights: np.ndarray, share: float):
        self.points = slice(first, first + len(weights))
        self.weights, self.share = weights, share

    def gauss(self, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return depths in the layer and weights (count,) of a Gauss rule, and shape functions of points (count, m)."""
        at, weights = np.polynomial.legendre.leggauss(count)
        depths = (at + 1) / 2
        return depths, weights / 2, lagrange(gauss_lobatto(len(self.weights) - 1)[0], depths)


class ColumnBasis:
    """Basis of the temperatures through the thickness of a sheet, with m points.

    shares: thickness of each layer over that of the sheet, from the bottom up; properties, names: of each layer.

    Attributes:
        depths: depths of the points, from 0 at the bottom face to 1 at the top face, shape (m,).
        capacity: heat capacity of the points, over the thickness, heat per volume and degree, shape (m,).
        conductivity: conductivity matrix K for the thickness 1, heat per time, length and degree, shape (m, m).
        rates: rates mu of the modes for the thickness 1, length^2/time, shape (m,).
        modes: modes v in columns, shape (m, m), with v C v = 1.
        layers: {name: its `Layer`}.
    """

    def __init__(self, shares: Sequence[float], properties: Sequence[Any], names: Sequence[str]):
        from scipy.linalg import eigh
        order = _ORDER if len(shares) == 1 else _ORDER_OF_LAYER
        at, weights, slopes = gauss_lobatto(order)
        m = order * len(shares) + 1
        self.depths, self.capacity, self.conductivity = np.zeros(m), np.zeros(m), np.zeros((m, m))
        self.layers: dict[str, Layer] = {}
        below = 0.0
        for k, (name, share, law) in enumerate(zip(names, shares, properties, strict=True)):
            layer = self.layers[name] = Layer(order * k, weights, share)
            self.depths[layer.points] = below + share * at
            self.capacity[layer.points] += share * law.density * law.heat_capacity * weights
            self.conductivity[layer.points, layer.points] += law.conductivity / share * slopes.T @ (
                weights[:, None] * slopes)
            below += share
        self.depths[-1] = 1.0
        self.rates, self.modes = eigh(self.conductivity, np.diag(self.capacity))
        self.rates = np.maximum(self.rates, 0.0)             # the first is 0 up to round-off

    def shapes(self, depths: np.ndarray) -> np.ndarray:
        """Return the shape functions of the m points at depths from 0 to 1, shape (n,), as rows, shape (n, m)."""
        found = np.zeros((len(depths), len(self.depths)))
        for layer in self.layers.values():
            points = self.depths[layer.points]
            rows = (depths >= points[0]) & (depths <= points[-1])
            found[rows] = 0.0
            found[rows, layer.points] = lagrange(points, depths[rows])
        return found


@cache
def gauss_lobatto(order: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points, weights and derivatives of the Gauss-Lobatto rule on [0, 1] with `order` + 1 = m points.

    Shapes (m,), (m,) and (m, m). Entry (i, j) of the last is the slope at point i of the polynomial that is 1 at j.
    """
    legendre = np.polynomial.legendre
    P = np.eye(order + 1)[order]
    x = np.concatenate([[-1.0], np.sort(legendre.legroots(legendre.legder(P)).real), [1.0]])
    at = legendre.legval(x, P)
    apart = x[:, None] - x + np.eye(order + 1)
    slopes = at[:, None] / at / apart
    np.fill_diagonal(slopes, 0.0)
    np.fill_diagonal(slopes, -slopes.sum(1))
    return (x + 1) / 2, 1 / (order * (order + 1) * at**2), 2 * slopes


def lagrange(nodes: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the Lagrange polynomials of m nodes at x, shape (n,), as rows, shape (n, m)."""
    apart = nodes[:, None] - nodes + np.eye(len(nodes))
    away = (x[:, None, None] - nodes) / apart                                 # factor k of polynomial j
    away[:, np.eye(len(nodes), dtype=bool)] = 1.0
    return np.asarray(away.prod(2))


def layer_shares(scene: Any) -> dict[str, float]:
    """Return {layer: its share of the thickness at the first node}, from the bottom up; collective."""
    x = scene.mesh.domain.geometry.x[:1].T
    own = [float(np.ravel(scene.thickness[name](*x))[0]) for name in scene.mesh.layers] if x.size else []
    h = next(found for found in scene.mesh.comm.allgather(own) if found)
    return {name: value / sum(h) for name, value in zip(scene.mesh.layers, h)}


def basis_of(scene: Any, materials: Any) -> ColumnBasis:
    """Return the basis of a scene's columns, bottom layer first; materials: {layer: properties}, or one for all."""
    materials = materials if isinstance(materials, Mapping) else dict.fromkeys(scene.mesh.layers, materials)
    shares = layer_shares(scene)
    return ColumnBasis([*shares.values()], [materials[name] for name in shares], [*shares])
