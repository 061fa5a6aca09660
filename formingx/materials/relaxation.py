"""Common base of materials that relax to an equilibrium, with the stresses of homogeneous tests over time."""

import copy
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError, as_list, check_type, finite_array, positive
from .material import Material


def checked_shift(name: str, shift: Any) -> Callable:
    """Return the law aT(T) of relaxation times; InputError by name unless it is callable."""
    if not callable(shift):
        raise InputError(f"{name}: shift = {shift!r}: must be WLF(...), Arrhenius(...) or a function of temperature")
    return shift


def checked_pairs(name: str, pairs: Any, what: str) -> list[list[Any]]:
    """Return pairs of constants as lists; none, or an entry that is no pair, is an InputError with `what`."""
    found = as_list(name, pairs, f"({what})")
    if not found:
        raise InputError(f"{name} = {pairs!r}: must be at least one ({what})")
    found = [as_list(f"{name}: number {k}", pair, what.replace(",", " and")) for k, pair in enumerate(found, 1)]
    for k, pair in enumerate(found, 1):
        if len(pair) != 2:
            raise InputError(f"{name}: number {k} is {tuple(pair)!r}: must be ({what})")
    return found


class RelaxingMaterial(Material):
    """Base class of materials that relax to an equilibrium.

    Subclasses add their own constants to `parameters` and call `check`. They define `_modulus(times)`, the relaxation
    modulus without the equilibrium, and `stress(mode, stretches, times=, between=)`, the nominal stress of a
    homogeneous test over time.

    Args:
        equilibrium: material without history that describes the relaxed state; None if all stress relaxes.

    Raises:
        InputError: `equilibrium` is no material, or has a history.
    """

    stress: Any

    def __init__(self, equilibrium: Material | None):
        name = type(self).__name__
        if equilibrium is not None:
            check_type(f"{name}: equilibrium", equilibrium, Material, "a material, or None")
            if equilibrium.internal or equilibrium.integral:
                raise InputError(f"{name}: equilibrium = {equilibrium}: must not relax itself, nor remember anything:"
                                 f" give all branches here")
        self._equilibrium = equilibrium
        self.parameters = {} if equilibrium is None else dict(equilibrium.parameters)

    def _modulus(self, times: Any) -> np.ndarray:
        """Return the relaxation modulus without the modulus of the equilibrium, stress, of the shape of `times`."""
        raise NotImplementedError

    def relaxation_modulus(self, times: ArrayLike) -> np.ndarray:
        r"""Return the small-strain relaxation modulus, the shear stress over a sudden shear strain.

        .. math:: G(t) = G_\infty + \sum_k G_k \exp(-t / \tau_k)

        Here :math:`G_\infty` is the modulus of the equilibrium; branch k has the modulus G_k and the relaxation time
        tau_k.

        Args:
            times: times t after the strain, any shape.

        Returns:
            Moduli G, the shape of `times`, stress.
        """
        modulus = 0.0 if (rest := self.equilibrium) is None else rest.shear_modulus
        return modulus + self._modulus(finite_array("relaxation_modulus: times", times))

    @property
    def shear_modulus(self) -> float:
        """Shear modulus of the instantaneous response, stress."""
        self._numbers()
        return float(self.relaxation_modulus(0.0))

    @property
    def rest_stress(self) -> float:
        """Nominal stress dW/dF11 of the equilibrium energy W at F = I, in the unit of stress; 0 if all stress relaxes.

        By default a solid subtracts this stress times ln J from W, to be stress-free at F = I. Relaxing branches are
        stress-free there.
        """
        return 0.0 if (rest := self.equilibrium) is None else rest.rest_stress

    @property
    def largest_I1(self) -> float:
        """Value of I1 at which the equilibrium energy becomes infinite; infinity if there is none."""
        return np.inf if (rest := self.equilibrium) is None else rest.largest_I1

    def check_constants(self, **constants: Any) -> None:
        if self._equilibrium is not None:
            self._equilibrium.check_constants(**{k: constants[k] for k in self._equilibrium.parameters})

    def equilibrium_energy(self, F: Any, **constants: Any) -> Any:
        return None if self._equilibrium is None else self._relaxed_energy(F, constants)

    def _relaxed_energy(self, F: Any, constants: dict[str, Any]) -> Any:
        """Return the relaxed energy at F (UFL, stress), from {name: value} of constants; 0 if none stays."""
        if self._equilibrium is None:
            return 0
        return self._equilibrium.strain_energy(F, **{k: constants[k] for k in self._equilibrium.parameters})

    def _relaxed_stress(self, mode: str, stretches: Any) -> Any:
        """Return the relaxed nominal stress in a test, of the shape of `stretches`; 0 if none stays."""
        return 0.0 if (rest := self.equilibrium) is None else rest.stress(mode, stretches)

    @property
    def equilibrium(self) -> Material | None:
        """Material that describes the relaxed state; None if all stress relaxes."""
        if self._equilibrium is None:
            return None
        rest = copy.copy(self._equilibrium)
        rest.parameters = {k: self.parameters[k] for k in self._equilibrium.parameters}
        return rest

    def relaxation(self, mode: str, stretch: float, times: ArrayLike) -> np.ndarray:
        """Return the nominal stress over time in a relaxation test: a sudden stretch that is then constant.

        Args:
            mode: "uniaxial", "pure_shear" or "equibiaxial".
            stretch: the stretch, positive.
            times: times after the stretch, any shape, not negative.

        Returns:
            Nominal stress, the shape of `times`, stress.

        Raises:
            InputError: a time is negative.
        """
        t = np.asarray(times, float)
        if not np.all(t >= 0):
            raise InputError(f"{self}: relaxation: times = {times!r}: must not be negative")
        ordered, back = np.unique(np.append(0.0, t.ravel()), return_inverse=True)
        constant = np.full(len(ordered), positive(f"{self}: relaxation: stretch", stretch))
        return self.stress(mode, constant, times=ordered)[back[1:]].reshape(t.shape)[()]

    def constant_rate(self, mode: str, rate: float, stretches: ArrayLike) -> np.ndarray:
        r"""Return the nominal stress in a test at a constant Hencky rate, from the reference configuration.

        .. math:: l(t) = \exp(\pm \dot\varepsilon t)

        The sign is + for stretches above 1 and - for stretches below 1.

        Args:
            mode: "uniaxial", "pure_shear" or "equibiaxial".
            rate: absolute rate of the logarithmic strain in the loaded direction, 1/time, positive.
            stretches: stretches l in the loaded direction, shape (n,), all above or all below 1.

        Returns:
            Nominal stress at these stretches, shape (n,), stress.

        Raises:
            InputError: some stretches are above 1 and others below.
        """
        rate = positive(f"{self}: constant_rate: rate", rate)
        t = np.abs(np.log(np.asarray(stretches, float))) / rate
        ordered, back = np.unique(np.append(0.0, t), return_inverse=True)
        l = np.exp(ordered * rate * np.sign(np.log(np.sum(stretches) / np.size(stretches))))
        if not np.allclose(l[back[1:]], stretches, rtol=1e-12):
            raise InputError(f"{self}: constant_rate: stretches = {stretches!r}: must be all above or all below 1")
        return self.stress(mode, l, times=ordered, between="strain")[back[1:]]
