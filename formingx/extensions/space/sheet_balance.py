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

    def _body_energies(self, a: Any, b: Any) -> dict[str, float]:
        found = super()._body_energies(a, b)
        slides = [contact for contact in self._problem.contacts if _has_friction(contact)]
        friction, bonds, carried = self._absorbed(a, b)
        for name, value, there in (("friction", friction, slides),
                                   ("bonds", bonds, len(slides) < len(self._problem.contacts))):
            found.pop(name, None)
            if there:
                found[name] = value
        if carried:                                          # pressure between the points, which the tools carry
            name = next(name for (name, _), load in zip(self._loads, self._problem.scene.loads)
                        if isinstance(load, Pressure))
            found[name] -= carried
        return found

    def _absorbed(self, a: Any, b: Any) -> tuple[float, float, float]:
        """Return the energies that contacts absorb in a step: with friction, without, and by carried pressures."""
        found = np.zeros(3)
        if a.setting != b.setting or b.kind == "jump":
            return 0.0, 0.0, 0.0
        ends = []
        for state in (a, b):
            with self._problem.state_context(state) as problem:
                fields, forces = state.x[: problem.n_owned], []
                for contact in problem.contact.faces:
                    own = contact.area[:, None] * contact.tractions(fields, state.control).force
                    all_forces = contact.forces(fields, state.control)
                    forces.append((_has_friction(contact), contact.positions(fields, state.control), own,
                                   all_forces - own))
                ends.append(forces)
        for (slides, xa, *fa), (_, xb, *fb) in zip(*ends):
            own, carried = (self._sum(np.einsum("ni,ni->n", (p + q) / 2, xb - xa)) for p, q in zip(fa, fb))
            found += [own if slides else 0.0, 0.0 if slides else own, carried]
        return float(found[0]), float(found[1]), float(found[2])


def _has_friction(contact: Any) -> bool:
    """Return True if the points of a contact slide with friction."""
    return not contact.contact.sticks and (contact.contact.friction_by_temperature or contact.contact.mu > 0)
