"""Tests of a material whose stress depends on the history: a stretch that is held, a constant Hencky rate."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError, positive
from .material import Material


def checked_shift(name: str, shift: Any) -> Callable:
    """A law by which relaxation times depend on the temperature, or an InputError."""
    if not callable(shift):
        raise InputError(f"{name}: shift = {shift!r}: must be WLF(...), Arrhenius(...) or a function of temperature")
    return shift


class HistoryTests:
    """What is left of a material that relaxes, and tests of it, by `stress(mode, stretches, times=, between=)`."""

    stress: Any
    parameters: dict[str, Any]
    _equilibrium: Material | None

    @property
    def equilibrium(self) -> Material | None:
        """The material that is left when all branches have relaxed, or None."""
        if self._equilibrium is None:
            return None
        rest = copy.copy(self._equilibrium)
        rest.parameters = {k: self.parameters[k] for k in self._equilibrium.parameters}
        return rest

    def relaxation(self, mode: str, stretch: float, times: ArrayLike) -> np.ndarray:
        """Nominal stress at times (any shape, at least 0) after a stretch was put on at once, and held; stress."""
        t = np.asarray(times, float)
        if not np.all(t >= 0):
            raise InputError(f"{self}: relaxation: times = {times!r}: must not be negative")
        ordered, back = np.unique(np.append(0.0, t.ravel()), return_inverse=True)
        held = np.full(len(ordered), positive(f"{self}: relaxation: stretch", stretch))
        return self.stress(mode, held, times=ordered)[back[1:]].reshape(t.shape)[()]

    def constant_rate(self, mode: str, rate: float, stretches: ArrayLike) -> np.ndarray:
        """Nominal stress at stretches, shape (n,), all above or all below 1, met at a constant Hencky rate; stress.

        Args:
            rate: of the logarithmic strain in the direction pulled, 1/time, above 0 (pushed: of its size).
        """
        rate = positive(f"{self}: constant_rate: rate", rate)
        t = np.abs(np.log(np.asarray(stretches, float))) / rate
        ordered, back = np.unique(np.append(0.0, t), return_inverse=True)
        l = np.exp(ordered * rate * np.sign(np.log(np.sum(stretches) / np.size(stretches))))
        if not np.allclose(l[back[1:]], stretches, rtol=1e-12):
            raise InputError(f"{self}: constant_rate: stretches = {stretches!r}: must be all above or all below 1")
        return self.stress(mode, l, times=ordered, between="strain")[back[1:]]
