"""Measured stresses of homogeneous tests without time as one vector."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import InputError, check_name
from ...materials import homogeneous
from .weights import divisors, in_range, named_weights


class Points:
    """Measured stresses of elastic tests, which state no times, checked, as one vector of m numbers.

    A biaxial test has two stresses at each of its points, the other tests have one. Inconsistent tests, no strain, or
    no point within the range are an InputError.

    Attributes:
        data: the tests as given.
        stretches_of: {test: stretches of its n points that count}, shape (n,); of "biaxial" (2, n).
        measured: nominal stresses, shape (m,), test by test.
        sizes: stress by which each misfit is divided, shape (m,).
        parts: {test: slice of its stresses in `measured`}.
        largest_I1: largest first invariant of C at the points.
    """

    def __init__(self, data: Any, relative: bool, weights: Any, within: Any):
        if not isinstance(data, dict) or not data:
            raise InputError(f"fit: data = {data!r}: must be {{test: (stretch, nominal stress)}}")
        self.data = data
        tests = {mode: _checked(mode, columns) for mode, columns in data.items()}
        if all(np.all(l[0] == 1) and np.all(l[1] == 1) for l, _ in tests.values()):
            raise InputError("fit: data: every stretch is 1: nothing is strained")
        weight = named_weights(weights, list(tests))
        kept = {mode: _within_range(mode, l, P, within) for mode, (l, P) in tests.items()}
        stresses = [P[np.isfinite(P)] for _, P in kept.values()]
        largest = max((np.abs(P).max() for P in stresses if len(P)), default=0.0)
        if not any(len(P) for P in stresses):
            raise InputError(f"fit: within = {within!r}: no point of the data lies there")
        if not 1e-50 <= largest <= 1e50:
            raise InputError(f"fit: data: the largest stress is {largest:g}: must be from 1e-50 to 1e50: use another"
                             f" unit")
        used = {mode: (l, P, w) for (mode, (l, P)), w in zip(kept.items(), weight) if np.any(np.isfinite(P))}
        self.measured = np.concatenate([P[np.isfinite(P)] for _, P, _ in used.values()])
        self.sizes = divisors([P[np.isfinite(P)] for _, P, _ in used.values()], relative,
                              [w for *_, w in used.values()])
        self.stretches_of = {mode: l if mode == "biaxial" else l[0] for mode, (l, *_) in used.items()}
        self.parts, n = {}, 0
        for mode, (_, P, _) in used.items():
            self.parts[mode] = slice(n, n := n + int(np.isfinite(P).sum()))
        self._stretches = np.concatenate([l for l, *_ in used.values()], axis=1)
        self._measured_mask = np.concatenate([np.isfinite(P) for _, P, _ in used.values()], axis=1)
        self._rows = np.concatenate([np.full(P.shape[1], k) for k, (_, P, _) in enumerate(used.values())])
        l1, l2 = self._stretches
        self.largest_I1 = float((l1**2 + l2**2 + (l1 * l2) ** -2).max())

    def stress(self, response: Any, constants: Any) -> np.ndarray:
        """Return the stresses of a material at its constants, (m,), as `measured`; inf or nan beyond its limit."""
        return self._in_order(response.stress(self._stretches, list(constants)))

    def modulus(self) -> float:
        """Return the median of measured stresses over those of a neo-Hookean material of unit modulus, stress."""
        l1, l2 = self._stretches
        with np.errstate(divide="ignore"):
            shape = self._in_order(np.stack([l1 - 1 / (l1**3 * l2**2), l2 - 1 / (l2**3 * l1**2)]))
        return float(np.median(self.measured[shape != 0] / shape[shape != 0]))

    def _in_order(self, values: np.ndarray) -> np.ndarray:
        """Return values of both directions at all n points, shape (2, n), in the order of `measured`, (m,)."""
        return np.concatenate([values[:, self._rows == k][self._measured_mask[:, self._rows == k]]
                               for k in range(len(self.parts))])


def _within_range(mode: str, l: np.ndarray, P: np.ndarray, within: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the stretches and stresses, (2, n), of points within a range, (2, k) each; biaxial: both in it."""
    inside = in_range(within, l).all(0) if mode == "biaxial" else in_range(within, l[0])
    return l[:, inside], P[:, inside]


def hint_if_strains(values: np.ndarray) -> str:
    """Return a hint for an error message if the stretches (n,) of a test are probably strains, or ""."""
    if not np.all(np.isfinite(values)) or np.min(values) > 0 and np.max(values) > 1 or np.min(values) <= -1:
        return ""
    return ". Is it strain? The stretch is 1 + strain, of percent 1 + strain/100"


def _checked(mode: str, columns: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return stretches and nominal stresses of a test in both in-plane directions, shape (2, n) each, checked.

    A stress that was not measured is nan. An unknown mode, wrong shapes, or inadmissible numbers are an InputError.
    """
    check_name("fit: data: test", mode, [*homogeneous.MODES, "biaxial"])
    biaxial = mode == "biaxial"
    what = "(stretch 1, stretch 2, nominal stress 1, nominal stress 2)" if biaxial else "(stretch, nominal stress)"
    try:
        given = [np.asarray(x, float) for x in columns]
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"fit: data[{mode!r}]: must be {what}, numbers") from None
    if len(given) != (4 if biaxial else 2):
        raise InputError(f"fit: data[{mode!r}]: must be {what}, numbers")
    first, P = given[0], given[-1]
    if first.ndim != 1 or any(x.shape != first.shape for x in given) or not len(first):
        raise InputError(f"fit: data[{mode!r}]: stretch has the shape {first.shape}, stress {P.shape}: must be (n,),"
                         f" the same for both")
    l = np.stack(given[:2]) if biaxial else homogeneous.in_plane_stretches(mode, np.where(first > 0, first, 1.0))
    stresses = np.stack(given[2:]) if biaxial else np.stack([P, np.full(len(P), np.nan)])
    at = np.stack(given[:2]) if biaxial else first[None]
    missing = np.isnan(stresses).all(0) | np.isinf(stresses).any(0)
    for i in np.flatnonzero(missing | ~np.all(np.isfinite(at) & (at > 0), axis=0))[:1]:
        raise InputError(f"fit: data[{mode!r}], point {i}: stretch = {first[i]}, stress = {P[i]}: must be finite,"
                         f" and the stretch greater than 0{hint_if_strains(first)}")
    for i in np.flatnonzero(np.any((at < 1e-3) | (at > 1e3), axis=0))[:1]:
        raise InputError(f"fit: data[{mode!r}], point {i}: stretch = {first[i]}: must be from 0.001 to 1000")
    return l, stresses
