"""Energy balance of a run: work done on the body by each load and tool, stored and dissipated energy.

Between two states of one stage the body is assumed to move on the cubic through both states and their tangents. The
work of loads is integrated along this curve by Gauss quadrature. Reactions of supports and tools are not smooth on the
interpolated body. So each reaction is also interpolated by a cubic in arc length, from its values and its slopes along
the two tangents. If a point is about to touch, the slope at that end is left out, which gives a parabola. Straight
lines are used in a snap-through, and in steps in which the process time is independent of the control.

If the energies of a step do not balance, the step is halved: a state in its middle is solved for from its start. The
halving is repeated until the change is negligible.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from ...contact import resultants
from ...contact.step_limit import TrialStep
from ...contact.tooling import Tooling
from ...errors import InputError
from ...findings import Finding, log_findings, percent
from ...solve.newton import Failure
from ...values.tolerances import DIFFERENCE_STEP, NOTICEABLE
from .step_polynomials import GAUSS, Polynomial, integral, interpolate

_LOSSES = "friction", "jumps", "bonds"
_MATERIAL_LOSSES = "dissipated_energy", "damage_energy"
_RAMP_EDGE = 0.06          # distance from the outer edge of the contact ramp, over its half width, that counts as 0
_STEP_IMBALANCE = 2e-4     # allowed imbalance of a step over the largest strain energy of the run
_MAX_HALVINGS = 6              # largest number of halvings of a step
_SPLIT_OFFSET = 0.15       # distance from the middle of a step at which it is split if no state is found there


class _SupportReaction(NamedTuple):
    """Reaction of a driven support or a tool in a state, on the modelled body: the whole, a half or a quarter.

    Attributes:
        force: force of the support or tool on the body along its travel, stress length^2.
        slope: derivative of the force with respect to arc length.
        travel: travel of the support or tool, length.
        travel_slope: derivative of the travel with respect to arc length.
    """

    force: float
    slope: float
    travel: float
    travel_slope: float


class EnergyBalance:
    """Energy balance of the states of one problem, for the whole part also if a half or a quarter is modelled."""

    def __init__(self, segment: Any):
        self._states, self._curve, self._problem = segment.states, segment.curve, segment.problem
        problem, scene = segment.problem, segment.problem.scene
        forms = problem.forms
        self._energy = forms.stress * forms.volume
        self._loads = [(_entry_name(scene, load), forms.compile(work))
                       for load, work in zip(scene.loads, forms.load_works, strict=True)]
        self._driven = [(i, item) for i, item in enumerate(scene.items)
                        if any(item is d for d in scene.drivable) and item not in scene.loads]
        self._stored = forms.compile(forms.energy) if scene.heat is not None or forms.elastic_supports else None
        self._ends: dict[int, tuple[Any, dict[str, _SupportReaction]]] = {}

    def rows(self) -> dict[str, np.ndarray]:
        """Return {entry: energy added from the previous state, shape (states,)}, stress length^3; collective.

        Loads, supports and tools have their work on the body. "friction", "jumps" and "bonds" are positive losses,
        "heat" and "change" energies by temperature and stage.
        """
        pairs = list(zip(self._states, self._states[1:]))
        found = [self._step_energies(a, b) for a, b in pairs]
        scale = max((abs(s.measures["strain_energy"]) for s in self._states), default=0.0)
        rows: list[dict[str, float]] = [{}]
        limit = _STEP_IMBALANCE * scale
        rows += [row if abs(_imbalance(row, a, b)) <= limit else self._refined(a, b, row, limit)
                 for (a, b), row in zip(pairs, found)]
        names = dict.fromkeys(name for row in rows for name in row)
        return {name: np.array([row.get(name, 0.0) for row in rows]) for name in names}

    def _refined(self, a: Any, b: Any, estimate: dict[str, float], small: float,
                times: int = _MAX_HALVINGS) -> dict[str, float]:
        """Return {entry: energy added} of a step from a to b, with further states between; collective.

        Halving ends below the change `small` of energy, or after `times`; without a state `estimate` remains.
        """
        middle = self._middle(a, b) if times and a.setting == b.setting and b.kind != "jump" else None
        if middle is None:
            return estimate
        halves = [(start, end, self._step_energies(start, end)) for start, end in ((a, middle), (middle, b))]
        if abs(sum(sum(_gains(row)) for *_, row in halves) - sum(_gains(estimate))) > small:
            halves = [(start, end, self._refined(start, end, row, small, times - 1)) for start, end, row in halves]
        (*_, found), (*_, second) = halves
        return {name: found.get(name, 0.0) + second.get(name, 0.0) for name in {**found, **second}}

    def _middle(self, a: Any, b: Any) -> Any:
        """Return a state near half the arc length from state a to state b, or None if none is found; collective.

        It is solved for with the history variables of a, and has its own, updated ones.
        """
        problem, curve, h = self._problem, self._curve, self._curve.distance(a, b)
        if not h:
            return None
        line = [replace(s, direction=(b.x - a.x) / h, slope=(b.control - a.control) / h) for s in (a, b)]
        parts = 0.5, 0.5 - _SPLIT_OFFSET, 0.5 + _SPLIT_OFFSET
        for part, (start, end) in itertools.product(parts, [line] if self._flows(a, b) else [(a, b), line]):
            with problem.state_context(a):
                if self._flows(a, b):
                    problem.history.clock = a.time + part * (b.time - a.time)
                problem.contact.limit.prepare(TrialStep(a.x, a.control, start.direction, start.slope, part * h))
                try:
                    found = curve.state_at_fraction(start, end, part)
                except Failure:                             # the contact iteration may converge elsewhere
                    continue
                finally:
                    curve.spent()
                if max(curve.distance(a, found), curve.distance(found, b)) >= h:
                    continue                                # beyond an end of the step
                problem.history.advance(found.x, found.control)
                found.history_variables, found.setting = problem.history.variables, b.setting
                return found
        return None

    @staticmethod
    def _flows(a: Any, b: Any) -> bool:
        """Return True if process time passes from state a to state b at a rate that the control does not set."""
        return bool(b.time != a.time and not b.setting["rate"][-1])

    def _step_energies(self, a: Any, b: Any) -> dict[str, float]:
        """Return {load, tool, loss or other entry: energy added to the whole part from state a to state b}."""
        images = self._problem.scene.symmetry_factor
        found = {name: images * value for name, value in self._body_energies(a, b).items()}
        return ({"jumps": b.jump.get("dissipated", 0.0)} if b.kind == "jump" else {}) | found

    def _body_energies(self, a: Any, b: Any) -> dict[str, float]:
        """Return {load, tool, loss, ...: energy added to the modelled body from a to b}, without snap-throughs."""
        found: dict[str, float] = {}
        if b.kind != "jump" and any(c.law.has_friction for c in self._problem.contacts):
            found["friction"] = self._friction(a, b)
        if self._problem.scene.heat is not None:
            found["heat"] = self._heat(a, b)
        if any(c.law.adhesive for c in self._problem.contacts):
            found["bonds"] = self._bonds(b) - self._bonds(a)
        if a.setting != b.setting:                          # a new stage: the body does not move
            if self._problem.forms.elastic_supports:
                found["change"] = self._energy_at(b) - self._energy_at(a)
            if "bonds" in found:                            # an inactive tool releases its bonds
                found["change"] = found.get("change", 0.0) + found["bonds"]
            return found
        straight = b.kind == "jump" or self._flows(a, b)    # the path has no tangents
        h = self._curve.distance(a, b)
        # a tool that touches the body from the start has a kink in its force: no tangent
        start = None if straight or a.kind == "start" and self._at_ramp_edge(a) else h
        end = None if straight else h
        x = interpolate(a.x, b.x, start and h * a.direction, end and h * b.direction)
        control = interpolate(a.control, b.control, start and h * a.slope, end and h * b.slope)
        found |= self._load_work(a, x, control)
        after = self._reactions(b)
        end = None if end is None or after and self._at_ramp_edge(b) else h
        for name, before in self._reactions(a).items():
            (f, df, y, dy), (g, dg, z, dz) = before, after[name]
            force = interpolate(f, g, start and h * df, end and h * dg)
            found[name] = integral(force, interpolate(y, z, start and h * dy, end and h * dz))
        return found

    def _load_work(self, a: Any, x: Polynomial, control: Polynomial) -> dict[str, float]:
        """Return {load: work in a step}, and as "change" the work of fading forces that a new stage left unbalanced.

        Unknowns and control are polynomials from 0 to 1 in the step.
        """
        problem = self._problem
        names = [name for name, _ in self._loads]
        found = dict.fromkeys(names, 0.0)
        with problem.state_context(a):
            n, fading = problem.n_owned, problem.fading_forces
            for s, w in zip(*GAUSS):
                rate = x.slope(s)[:n]
                problem.set_fields(x.value(s), control.value(s))
                for name, form in self._loads:
                    found[name] += w * self._sum(problem.assemble(form) * rate)
                if fading is not None:
                    unbalanced = (1 - control.value(s)) * self._energy * fading
                    found["change"] = found.get("change", 0.0) + w * self._sum(unbalanced * rate)
        return found

    def _reactions(self, state: Any) -> dict[str, _SupportReaction]:
        """Return {name of a driven support or tool: its reaction in a state}, computed once for each state."""
        if id(state) not in self._ends:
            self._ends[id(state)] = state, self._compute_reactions(state) if self._driven else {}
        return self._ends[id(state)][1]

    def _compute_reactions(self, state: Any) -> dict[str, _SupportReaction]:
        """Return {name of a driven support or tool: its reaction in a state}, computed anew; collective."""
        problem, found = self._problem, {}
        scene, forms = problem.scene, problem.forms
        scale = forms.stress * forms.volume / forms.length
        with problem.state_context(state) as p:
            fields, n = p.x.array_r.copy(), p.n_owned
            e, d = DIFFERENCE_STEP, state.direction
            back = 0 if p.history.body_path_dependent and p.setting.rate[-1] else 1     # it relaxes forwards in time
            before, after = (p.body_forces(fields + k * e * d, state.control + k * e * state.slope) for k in (-back, 1))
            change = scale * (after - before)[:n] / ((1 + back) * e)
            free = change.copy()
            free[p.constrained] = 0                        # constrained unknowns
            for i, item in self._driven:
                setting = p.setting
                travel = forms.length * setting.amplitude(i, state.control)
                travel_slope = forms.length * setting.rate[i] * state.slope
                if i in setting.inactive:
                    force = slope = 0.0
                elif item in scene.contacts:
                    together = [scene.items[k] for k in scene.same_tool(i)]
                    tools = [c for c in p.contact.faces if c.contact in together]
                    force = -sum(float(resultants.force(c, fields, state.control) @ c.contact.travel_vector)
                                 for c in tools)
                    slope = sum(self._sum(free[self._nodes(c, fields, state.control)] @ c.contact.travel_vector)
                                for c in tools)
                else:
                    force = -p.reaction(i, p.x, state.control)
                    slope = self._sum(change[p.driven_unknowns(i)])
                found[_entry_name(scene, item)] = _SupportReaction(force, slope, travel, travel_slope)
        return found

    def _nodes(self, contact: Any, fields: np.ndarray, control: float) -> np.ndarray:
        """Return owned displacements (n, 2) of a face, if several contacts share it those of nodes in contact."""
        problem, dofs = self._problem, contact.rule.dofs
        if contact.contact.points == "nodes" and sum(c.contact.on == contact.contact.on for c in problem.contacts) > 1:
            return dofs[contact.touching(fields, control)]
        dofs = np.unique(dofs.reshape(-1, problem.scene.kinematics.components), axis=0)
        return dofs[dofs[:, 0] < problem.n_owned]

    def _at_ramp_edge(self, state: Any) -> bool:
        """Return True if a contact point is within 0.06 half-widths of the outer edge of the ramp; collective."""
        with self._problem.state_context(state) as problem:
            x, control = state.x[: problem.n_owned], state.control
            return self._sum([np.any(np.abs(c.law.distance(c.positions(x, control)) / c.law.theta + 1) < _RAMP_EDGE)
                              for c in problem.contact.faces]) > 0

    def _friction(self, a: Any, b: Any) -> float:
        """Return the energy that friction on the modelled body dissipates from state a to state b, stress length^3.

        It is the sum over points of area times mean tangential traction times increment of inelastic slip.
        """
        problem, lost, before = self._problem, 0.0, {}
        contacts = [c for c in problem.contacts if c.law.has_friction and not c.contact.sticks]
        if a.setting != b.setting or not contacts:
            return lost
        with problem.state_context(a):
            for c in (c for c in contacts if c in problem.contact.faces):
                before[c] = c.positions(a.x[: problem.n_owned], a.control), c.history, _friction_of(c, a, problem)
        with problem.state_context(b):
            for c, (x, history, T) in before.items():
                slid = _slip_of(c.law, x, history, c.positions(b.x[: problem.n_owned], b.control)) - c.history.slip
                lost += self._sum(c.rule.area * (T + _friction_of(c, b, problem)) / 2 * slid)
        return lost

    def _heat(self, a: Any, b: Any) -> float:
        """Return the energy of the change of temperature from a to b: the mean at the displacements of a and of b."""
        cold, warm = a.history_variables[-1], b.history_variables[-1]        # the temperature is last

        def stored(state: Any, temperature: Any) -> float:
            still = temperature._replace(before=None)                         # no previous temperature
            return self._energy_at(replace(state, history_variables=[*state.history_variables[:-1], still]))
        return sum(stored(state, warm) - stored(state, cold) for state in (a, b)) / 2

    def _energy_at(self, state: Any) -> float:
        """Return the energy stored in the modelled body and its elastic supports in a state; collective."""
        with self._problem.state_context(state) as problem:
            return self._energy * problem.assemble_scalar(self._stored)

    def _bonds(self, state: Any) -> float:
        """Return the energy stored in the contacts of the modelled body with adhesive tools in a state."""
        with self._problem.state_context(state) as p:
            return sum(resultants.energy(c, state.x[: p.n_owned], state.control)
                       for c in p.contact.faces if c.law.adhesive)

    def _sum(self, values: Any) -> float:
        """Return the sum of an array, or of a number, over all entries and ranks; collective."""
        return float(self._problem.comm.allreduce(float(np.sum(values)), MPI.SUM))


def _gains(row: dict[str, float]) -> list[float]:
    """Return the energies of a step in the order of `row`, as gains of the body: losses change their sign."""
    return [-value if name in _LOSSES else value for name, value in row.items()]


def _imbalance(row: dict[str, float], a: Any, b: Any) -> float:
    """Return the gains in a step from a to b minus the changes of stored and dissipated energy."""
    names = "strain_energy", *_MATERIAL_LOSSES
    return sum(_gains(row)) - sum(b.measures.get(name, 0.0) - a.measures.get(name, 0.0) for name in names)


def _friction_of(contact: Any, state: Any, problem: Any) -> np.ndarray:
    """Return the tangential traction on the tool at n contact points, positive along its tangent, (n,), stress."""
    return contact.tractions(state.x[: problem.n_owned], state.control).tangential


def _slip_of(law: Any, x: np.ndarray, history: Any, end: np.ndarray) -> np.ndarray:
    """Return the elastic slip of n contact points at the start of a step, plus the slip in it, (n,), length.

    Points move from x to `end`, (n, 2), relative to the tool, on straight lines; only the part in contact counts.
    """
    nearest, outer_edge = law.nearest(end), -law.theta
    touched, touches = history.distance > outer_edge, nearest.distance > outer_edge
    approach = nearest.distance - history.distance
    crosses = np.divide(outer_edge - history.distance, approach, out=np.zeros(len(approach)), where=approach != 0)
    crosses = np.clip(crosses, 0.0, 1.0)
    share = np.where(touched, np.where(touches, 1.0, crosses), np.where(touches, 1 - crosses, 0.0))
    motion = share[:, None] * (end - x)
    return history.slip + np.sign(np.einsum("ni,ni->n", nearest.tangent, motion)) * np.hypot(*motion.T)


def _entry_name(scene: Any, item: Any) -> str:
    """Return the name of the entry of a load, support or contact of a scene in the energy balance."""
    if item in scene.contacts:
        return Tooling(scene.contacts, 0, 1.0).names[scene.contacts.index(item)]
    if item in scene.supports:
        return item.name or "support"
    if any(item is d for d in scene.drivable):
        return scene.column(item)
    if item.name is not None:
        return f"{item.name}_{item.quantity}"
    return item.quantity if item.on is None else f"{item.quantity}_on_{item.on}"


def work(path: Any) -> dict[str, np.ndarray]:
    """Return the energy balance of a run, and log a warning if more than 0.5 % is unbalanced; collective."""
    found = balance(path)
    new = [finding for finding in findings(found) if finding not in path.record.findings]
    log_findings(new, path.problem.comm.rank)
    path.record.findings += new
    return found


def findings(balanced: dict[str, np.ndarray]) -> list[Finding]:
    """Return a warning in a list if "unbalanced" exceeds 0.5 % of the largest entry of a balance; else []."""
    size = max(float(np.abs(values).max()) for values in balanced.values())
    unbalanced = np.abs(balanced["unbalanced"])
    k = int(np.argmax(unbalanced))
    if unbalanced[k] <= NOTICEABLE * size:
        return []
    return [Finding("warning", "energy", f"The energy balance is off by {percent(unbalanced[k] / size)} of the"
                    f" largest entry, up to state {k} ({100 * NOTICEABLE:g} % is usual): the states are too few for"
                    f" the work between them, contact is too soft, or the run is not accurate. Use shorter steps,"
                    f" StepControl(largest=...), and see path.work().")]


def balance(path: Any) -> dict[str, np.ndarray]:
    """Return {load, tool, support, "strain_energy", loss or "unbalanced": energy up to each state}; collective.

    Energies have shape (states,), stress length^3, in plane strain length^2. K-BKZ materials, whose energy is no
    function of the state, raise an InputError.
    """
    if "strain_energy" not in path.columns:
        raise InputError("Path.work: is not available with K-BKZ: its stored energy is no function of its state")
    balances = [getattr(segment.problem.forms, "energy_balance", EnergyBalance)(segment).rows()
                for segment in path.record.segments]
    names = dict.fromkeys(name for rows in balances for name in rows)
    empty = [np.zeros(len(segment.states)) for segment in path.record.segments]
    found = {name: np.cumsum(np.concatenate([rows.get(name, zero) for rows, zero in zip(balances, empty)]))
             for name in names}
    lost: dict[str, np.ndarray] = {name: found.pop(name) for name in _LOSSES if name in found}
    lost |= {name: path[name] for name in _MATERIAL_LOSSES if name in path.columns}
    stored = path["strain_energy"] - path["strain_energy"][0]
    zero = np.zeros(len(path))
    if len(path.record.segments) > 1:
        first = np.cumsum([len(segment.states) for segment in path.record.segments])[:-1]
        made = zero.copy()
        made[first] = stored[first] - stored[first - 1]
        found["new_meshes"] = np.cumsum(made)
    unbalanced = sum(found.values(), zero) - stored - sum(lost.values(), zero)
    return found | {"strain_energy": stored} | lost | {"unbalanced": unbalanced}
