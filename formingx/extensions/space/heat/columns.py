r"""Heat conduction through the thickness of a sheet in three dimensions, M dT/dt = R(T), in a column at each node.

Heat flows along the normal of the sheet only. With the thickness h of the deformed sheet at a node, and the heat fluxes
q into its faces, the temperature T(s) at the material depth 0 < s < 1 satisfies

.. math::
    \rho c \frac{\partial T}{\partial t} = \frac{k}{h^2} \frac{\partial^2 T}{\partial s^2} + Q, \qquad
    \frac{k}{h} \frac{\partial T}{\partial n} = q

(Carslaw and Jaeger, Conduction of Heat in Solids, 1959, chapter 3). A column thins as the triangles around its node
grow. In an implicit stage of a time step the modes of a column (`ColumnBasis`) decouple, so that only the temperatures
of its two faces remain unknown.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from mpi4py import MPI

from ....errors import ConvergenceError
from ....ranks import combined
from ....values.zones import Zones
from ...heat.boundaries import Absorption
from ...heat.contact import ContactWithTool, HeatContact
from ...heat.implicit_stage import ImplicitStage
from .basis import ColumnBasis

_MAX_ITERATIONS = 100
"""Largest number of Newton iterations for the temperatures of the faces; radiation in a long step may need many."""

_CONVERGED = 1e-10
"""Largest change of a face temperature in the last iteration, over the largest absolute temperature."""


class ColumnConduction:
    """Heat conduction in a column at each of the n locally owned nodes of a sheet, and in the tools that touch it.

    It has the methods that `formingx.extensions.heat.stepping` and the history of a `Cooling` call on a `Conduction`.
    The first array of a temperature state has the temperatures of the columns, shape (n, m), which begin at `start`,
    shape (n,). Entries of M and R are divided by `capacity`.

    Attributes:
        basis: the `ColumnBasis`.
        points: reference positions of the nodes, shape (n, 3), length.
        capacity: heat capacity of the modelled sheet, heat per degree.
        tool_contacts: a `HeatContact` for each `ContactWithTool`; call `update` after a change of the deformation.
        power: heat source, heat per time at the points over `capacity`, shape (n, m), or 0.
        names: names of the boundaries and sources of heat.
        thickness: current thickness of the nodes, shape (n,), length; set by `update`.
    """

    def __init__(self, nodes: Any, basis: ColumnBasis, boundaries: Sequence[Any], start: np.ndarray,
                 absolute_zero: float):
        self._nodes, self.basis, self._zero, self._first = nodes, basis, absolute_zero, start
        self.points, self._comm = nodes.points, nodes.comm
        self.power: Any = 0.0
        whole = nodes.area * nodes.thickness
        self.capacity = float(combined(self._comm, float(whole.sum() * basis.capacity.sum()), MPI.SUM))
        self._share = whole / self.capacity                             # times `basis.capacity`: the entries of M
        self._faces = {name: 0 if sign < 0 else len(basis.depths) - 1 for name, sign in nodes.faces.items()}
        self._laws = [_FaceLaw(b, self._faces[b.on], nodes.points, absolute_zero) for b in boundaries
                      if hasattr(b, "flux") and not isinstance(b, Absorption)]
        self._sources = [b for b in boundaries if isinstance(b, Absorption)]
        touching = [b for b in boundaries if isinstance(b, ContactWithTool)]
        self.tool_contacts = [HeatContact(b, np.arange(len(nodes.points)), nodes.points) for b in touching]
        self.names = [f"{type(b).__name__}({b.on!r})" for b in (*(law.law for law in self._laws), *self._sources,
                                                                 *touching)]
        self.thickness, self._inactive = nodes.thickness, set[int]()
        self.update()

    def start(self) -> list[np.ndarray]:
        """Return the initial temperatures of columns and tools."""
        return [np.repeat(self._first[:, None], len(self.basis.depths), axis=1),
                *(touch.start() for touch in self.tool_contacts)]

    def with_fixed_values(self, T: np.ndarray) -> np.ndarray:
        """Return the temperatures T, shape (n, m): no face of a sheet has a prescribed temperature."""
        return T

    def set_inactive(self, laws: Sequence[Any]) -> None:
        """Leave out some laws of heat; `update` must follow."""
        self._inactive = {id(law) for law in laws}
        for entry in self._laws:
            entry.active = id(entry.law) not in self._inactive

    def update(self) -> None:
        """Update thickness, contact areas and absorbed heat after a change of the deformation."""
        ratio = self._nodes.area_ratio()
        self.thickness = self._nodes.thickness / ratio
        for touch in self.tool_contacts:
            touch.area = self._nodes.area * ratio / self.capacity
        self._absorbed = [self._absorption(source) for source in self._sources]

    def displacements(self) -> np.ndarray:
        """Return the displacements of the nodes, shape (n, 3), length."""
        return np.asarray(self._nodes.displacements())

    def rates(self, state: list[np.ndarray]) -> tuple[list[np.ndarray], np.ndarray]:
        """Return the rates of heat M dT/dt, with the shapes of `state`, and the heat per time of laws and tools.

        Rates of the columns are over `capacity`, degrees per time; those of tools per contact area.
        """
        T, found, through = state[0], [], []
        fluxes = [law.flux(T[:, law.point])[0] for law in self._laws]
        R = self._rate(T, fluxes)
        for touch, excess in zip(self.tool_contacts, state[1:], strict=True):
            face = self._faces[touch.on]
            q, rate = touch.rates(excess, T[:, face])
            R[:, face] += touch.area * q
            through.append(touch.area @ q)
            found.append(rate)
        return [R, *found], self._heats(fluxes, through)

    def stage(self, state: list[np.ndarray], known: list[np.ndarray], c: float, guess: np.ndarray) -> ImplicitStage:
        """Solve M Delta = k + c R(y + Delta) for columns and tools, with y `state`, k `known` and c in time."""
        T = state[0]
        responses = [touch.response(excess, k, c) for touch, excess, k in zip(self.tool_contacts, state[1:], known[1:])]
        sources = sum(self._absorbed) + self.power
        forced = known[0] + c * sources - c * (self._share / self.thickness**2)[:, None] * (T @ self.basis.conductivity)
        change, fluxes = self._solve(T, forced, c, self._laws, responses)
        R, changes, rates, through = self._rate(T + change, fluxes), [change], [], []
        for touch, response, k in zip(self.tool_contacts, responses, known[1:]):
            face = self._faces[touch.on]
            q, moved, rate = touch.flux_and_change(response, k, (T + change)[:, face], c)
            R[:, face] += touch.area * q
            through.append(touch.area @ q)
            changes.append(moved)
            rates.append(rate)
        return ImplicitStage(changes, [R, *rates], self._heats(fluxes, through))

    def difference(self, known: list[np.ndarray], c: float) -> tuple[float, np.ndarray]:
        r"""Solve M Delta = k + c R' Delta; return the largest change on all ranks and the columns', (n, m), degrees."""
        responses = [touch.response(0 * k, k, c, absolute=False) for touch, k in zip(self.tool_contacts, known[1:])]
        laws = [law.linearised() for law in self._laws]
        change, _ = self._solve(0 * known[0], known[0], c, laws, responses)
        sizes = [np.abs(change).max(initial=0.0)]
        for touch, response, k in zip(self.tool_contacts, responses, known[1:]):
            moved = touch.flux_and_change(response, k, change[:, self._faces[touch.on]], c)[1]
            sizes.append(np.abs(moved).max(initial=0.0))
        return float(combined(self._comm, float(max(sizes)), MPI.MAX)), change

    def mass(self, change: np.ndarray) -> np.ndarray:
        """Return M, over `capacity`, times a change of temperatures; both shape (n, m), degrees."""
        return self._share[:, None] * self.basis.capacity * change

    def stored(self, change: np.ndarray) -> float:
        """Return the heat stored by a change of temperatures, shape (n, m), degrees, summed over ranks."""
        return self.capacity * float(combined(self._comm, float(self.mass(change).sum()), MPI.SUM))

    def heat_through_fixed_faces(self, missing: np.ndarray) -> np.ndarray:
        """Return the heat through faces of prescribed temperature: there are none."""
        return np.zeros(0)

    def destroy(self) -> None:
        """Do nothing: there are no PETSc objects."""

    def _solve(self, T: np.ndarray, forced: np.ndarray, c: float, laws: Sequence[Any],
               responses: Sequence[Any]) -> tuple[np.ndarray, list[np.ndarray]]:
        """Return the change of the columns in an implicit stage, shape (n, m), and the fluxes of the laws, (n,) each.

        forced: right-hand side without fluxes at the faces, shape (n, m). In terms of modes the matrix is diagonal; a
        flux changes both faces by the compliance Z. Newton's method finds the temperatures of the faces.
        """
        modes, ends = self.basis.modes, [0, len(self.basis.depths) - 1]
        decay = 1 / (1 + c * np.outer(1 / self.thickness**2, self.basis.rates))
        free = decay * ((forced / self._share[:, None]) @ modes)                 # modes of the change without fluxes
        faces = modes[ends]                                                      # of the modes at both faces, (2, m)
        Z = np.einsum("fj,nj,gj->nfg", faces, decay, faces) * (c / self.thickness)[:, None, None]
        start = T[:, ends] + free @ faces.T
        x = start.copy()
        sides = [int(law.point > 0) for law in laws]
        for _ in range(_MAX_ITERATIONS):
            q, slope = np.zeros_like(x), np.zeros_like(x)
            found = [law.flux(x[:, side]) for law, side in zip(laws, sides)]
            for (flux, change), side in zip(found, sides):
                q[:, side] += flux
                slope[:, side] += change
            for touch, response in zip(self.tool_contacts, responses):
                side = int(self._faces[touch.on] > 0)
                q[:, side] += response.conductance * (response.face_temperature - x[:, side])
                slope[:, side] -= response.conductance
            G = x - start - np.einsum("nfg,ng->nf", Z, q)
            step = np.linalg.solve(np.eye(2) - Z * slope[:, None, :], G[..., None])[..., 0]
            x -= step
            scale = max(float(np.abs(x).max(initial=0.0)), 1e-300)
            if combined(self._comm, float(np.abs(step).max(initial=0.0) / scale), MPI.MAX) < _CONVERGED:
                q -= slope * step                            # at the last iterate, to first order
                fluxes = [flux - change * step[:, side] for (flux, change), side in zip(found, sides)]
                break
        else:
            raise ConvergenceError(f"heat: no temperature of the faces of the sheet was found in {_MAX_ITERATIONS}"
                                   f" iterations")
        through = decay * ((q * (c / self.thickness)[:, None]) @ faces)
        return (free + through) @ modes.T, fluxes

    def _rate(self, T: np.ndarray, fluxes: Sequence[np.ndarray]) -> np.ndarray:
        """Return the rate of heat of the columns without tools, over `capacity`, shape (n, m), degrees per time."""
        R = sum(self._absorbed) + self.power - (self._share / self.thickness**2)[:, None] * (
            T @ self.basis.conductivity)
        for law, flux in zip(self._laws, fluxes):
            R[:, law.point] += self._share / self.thickness * flux
        return np.asarray(R)

    def _absorption(self, source: Absorption) -> np.ndarray:
        """Return the heat per time of absorbed radiation at the points, over `capacity`, shape (n, m)."""
        depth = self.basis.depths if self._faces[source.on] == 0 else 1 - self.basis.depths
        weights = np.zeros(len(depth))
        for layer in self.basis.layers.values():
            weights[layer.points] += layer.share * layer.weights
        flux = 0.0 if id(source) in self._inactive else source.flux
        density = flux * source.coefficient * np.exp(-source.coefficient * np.outer(self.thickness, depth))
        return np.asarray(self._share[:, None] * weights * density)

    def _heats(self, fluxes: Sequence[np.ndarray], tool_heats: Sequence[float]) -> np.ndarray:
        """Return the heat per time into the sheet from laws, sources and tools, summed over ranks, shape (k,)."""
        area = self._share / self.thickness
        local = [*(float(area @ flux) for flux in fluxes), *(float(found.sum()) for found in self._absorbed),
                 *tool_heats]
        return np.asarray(self.capacity * combined(self._comm, np.array(local, dtype=float), MPI.SUM))


class _FaceLaw:
    """Law of heat at one face, with its parameters at the n nodes.

    Attributes:
        law: the `Convection`, `Radiation` or `HeatFlux`.
        point: number of the point of a column at the face.
        active: False while a stage leaves the law out.
    """

    active = True

    def __init__(self, law: Any, point: int, points: np.ndarray, absolute_zero: float):
        self.law, self.point, self._zero = law, point, absolute_zero
        self._parameters: Mapping[str, Any] = {
            name: np.broadcast_to(value(*points[:, :2].T) if isinstance(value, Zones) else value, len(points))
            for name, value in law.parameters.items()}
        self._slope: Any = np.zeros(len(points))

    def flux(self, T: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the flux into the face at temperatures T, shape (n,), and its derivative by T, shape (n,)."""
        if not self.active:
            self._slope = np.zeros(len(T))
            return np.zeros(len(T)), self._slope
        found = np.asarray(self.law.flux(T + 1e-30j, self._zero, **self._parameters))     # a derivative without error
        self._slope = np.broadcast_to(found.imag, T.shape) / 1e-30
        return np.broadcast_to(found.real, T.shape), self._slope

    def linearised(self) -> _LinearLaw:
        """Return the law of differences of temperature, linearised at the temperatures of the last `flux`."""
        return _LinearLaw(self.point, self._slope)


class _LinearLaw:
    """Flux of differences of temperature at one face; `point` is the number of the point of a column there."""

    def __init__(self, point: int, slope: np.ndarray):
        self.point, self._slope = point, slope

    def flux(self, T: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the flux for differences T, shape (n,), and its derivative, shape (n,)."""
        return self._slope * T, self._slope
