"""Quadrature rule of the energy in a cell."""

from __future__ import annotations

from typing import Any, NamedTuple, Self

import basix
import basix.ufl
import numpy as np


class EnergyRule(NamedTuple):
    """Quadrature rule of the energy in a cell, with q points.

    Attributes:
        cell: type of the cell (basix).
        places: points in the reference cell, shape (q, dimension). A point may occur several times, for several depths
            of a sheet.
        weights: weights of the points, shape (q,).
        metadata: metadata of a UFL measure with this rule.
        options: arguments of `basix.ufl.quadrature_element` that name this rule.
    """

    cell: Any
    places: np.ndarray
    weights: np.ndarray
    metadata: dict[str, Any]
    options: dict[str, Any]

    @classmethod
    def of_degree(cls, cell: Any, degree: int) -> Self:
        """Return the default rule of a polynomial degree."""
        places: Any
        weights: Any
        places, weights = basix.make_quadrature(cell, degree)
        return cls(cell, places, weights, {"quadrature_degree": degree}, {"scheme": "default", "degree": degree})

    def through(self, weights: np.ndarray) -> EnergyRule:
        """Return this rule with each point repeated for m depths of a sheet, of weights, shape (m,), whose sum is 1."""
        places = np.repeat(self.places, len(weights), axis=0)
        products = np.outer(self.weights, weights).ravel()
        metadata = {"quadrature_rule": "custom", "quadrature_points": places.view(_RuleArray),
                    "quadrature_weights": products.view(_RuleArray)}
        return EnergyRule(self.cell, places, products, metadata, {"points": places, "weights": products})

    def element(self, shape: tuple[int, ...] = ()) -> Any:
        """Return the quadrature element with a value of a given shape at each point."""
        return basix.ufl.quadrature_element(self.cell.name, value_shape=shape, **self.options)


class _RuleArray(np.ndarray):
    """Points or weights of a rule in the metadata of a measure: they take part in the signature of a form."""

    @property
    def ufl_signature(self) -> str:
        """All digits of the array, as text."""
        return self.tobytes().hex()
