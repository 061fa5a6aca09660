"""Energy balance of a sheet in three dimensions: work of contact with tools in three dimensions, by lagged laws."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...physics.loads import Pressure
from ...results.evaluate.work import EnergyBalance


class SheetBalance(EnergyBalance):
    r"""Energy balance of the states of one problem of a sheet in three dimensions.

    The contact forces t per area A absorb the energy

    .. math:: \sum_i \tfrac{1}{2} (A_i^a t_i^a + A_i^b t_i^b) \cdot (x_i^b - x_i^a)

    in a step from a to b, with the positions x relative to the tool. Contacts with friction lose it. Without friction,
    and where the sheet sticks, the penalty stores it ("bonds"). A point whose gap closed in the last step carries no
    force yet.
    """

    def __init__(self, segment: Any):
        super().__init__(segment)
        forms = self._problem.forms
        removed = iter(forms.pressure_works)
        if forms.pressure_works:                             # without the tangential part on a sheet that slides
            self._loads = [(name, forms.compile(work + next(removed)[0]) if isinstance(load, Pressure) else form)
                           for (name, form), work, load in zip(self._loads, forms.load_works, forms.scene.loads)]

    def _body_energies(self, a: Any, b: Any) -> dict[str, float]:
        found = super()._body_energies(a, b)
        slides = [contact.law for contact in self._problem.contacts if _has_friction(contact)]
        for name, sliding in (("friction", True), ("bonds", False)):
            found.pop(name, None)
            if len(slides) if sliding else len(slides) < len(self._problem.contacts):
                found[name] = self._absorbed(a, b, sliding)
        return found

    def _absorbed(self, a: Any, b: Any, sliding: bool) -> float:
        """Return the energy that contacts absorb in a step, those with friction or the others, stress length^3."""
        if a.setting != b.setting or b.kind == "jump":
            return 0.0
        ends = []
        for state in (a, b):
            with self._problem.state_context(state) as problem:
                fields = state.x[: problem.n_owned]
                ends.append([(c.positions(fields, state.control),
                              c.area[:, None] * c.tractions(fields, state.control).force)
                             for c in problem.active_contacts if _has_friction(c) == sliding])
        return sum(self._sum(np.einsum("ni,ni->n", (fa + fb) / 2, xb - xa)) for (xa, fa), (xb, fb) in zip(*ends))


def _has_friction(contact: Any) -> bool:
    """Return True if the points of a contact slide with friction."""
    return not contact.contact.sticks and (contact.contact.friction_by_temperature or contact.contact.mu > 0)
