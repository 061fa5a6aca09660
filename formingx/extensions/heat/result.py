"""Result of a run of `heat`: temperatures of a body over time."""

from typing import Any, NamedTuple

import numpy as np
from dolfinx import fem

from ...errors import InputError, check_name, finite
from ...ranks import gathered
from ...results import files
from ...scene.fields import PointReader
from ...values.temperature import DEGREES
from .conduction import Conduction

_LINE_POINTS = 201
"""Number of points on a line through the body."""


class Spot(NamedTuple):
    """Node of a body with the highest or lowest temperature.

    Attributes:
        temperature: temperature of the node.
        R: reference radius of the node, length.
        Z: reference height of the node, length.
    """

    temperature: float
    R: float
    Z: float


class Window(NamedTuple):
    """Times at which the temperatures of a body enter and leave a range.

    Attributes:
        reached: first time at which the whole body is in the range; None if this never happens.
        left: first time after `reached` at which a part of the body leaves the range; None if this never happens.
    """

    reached: float | None
    left: float | None


class HeatRun:
    """Temperatures of a body over time, at every accepted step of `heat`.

    Within a step the temperature is a cubic in time; output times are ends of steps.

    Args:
        body: heat equation of the body.
        unit: unit of temperatures, "C" or "K".
        outputs: requested output times, shape (k,).

    Attributes:
        mesh: mesh of the computation: the given mesh, with elements cut into layers below faces that exchange heat.
        outputs: requested output times, shape (k,).
        errors_in_space: estimated largest discretisation error of the temperature at these times, shape (k,), degrees.
        unit: unit of temperatures, "C" or "K".
        states: for each step a list of arrays. The first has the temperatures of the body at its locally owned nodes,
            shape (n,). One follows for each tool in contact: its excess temperatures over its back, at m nodes along
            the depth, shape (contact nodes, m).
    """

    def __init__(self, body: Conduction, unit: str, outputs: np.ndarray):
        self._body, self.unit, self.outputs = body, unit, outputs
        self.mesh, self._comm = body.mesh, body.comm
        self.states = [body.start()]
        self._times, self._errors, self._stored = [0.0], [0.0], [0.0]
        self._heats = [np.zeros(len(body.names))]
        self.errors_in_space: np.ndarray = np.zeros(len(outputs))

    def record(self, time: float, step: Any) -> None:
        """Append an accepted step to the run.

        Args:
            time: time at the end of the step.
            step: the `formingx.extensions.heat.stepping.Step`.
        """
        self.states.append(step.state)
        self._times.append(time)
        self._errors.append(step.error)
        self._stored.append(step.stored)
        self._heats.append(step.heats)

    @property
    def times(self) -> np.ndarray:
        """Times at the ends of the n steps, the first 0, shape (n,)."""
        return np.array(self._times)

    @property
    def errors(self) -> np.ndarray:
        """Estimated time integration error of each step, degrees, shape (n,); the first is 0."""
        return np.array(self._errors)

    @property
    def heat_stored(self) -> np.ndarray:
        """Heat that the body stores in each step, shape (n,); the first is 0. In plane strain it is per unit depth."""
        return np.array(self._stored)

    @property
    def heat_through(self) -> dict[str, np.ndarray]:
        """{boundary or source: heat that enters the body there in each step, shape (n,)}.

        In plane strain heats are per unit depth.
        """
        return dict(zip(self._unique_names(), np.array(self._heats).T))

    @property
    def balance(self) -> np.ndarray:
        """Error of the heat balance in each step, over the largest heat of the step, shape (n,), dimensionless.

        It is the heat stored by the body minus the heat through all boundaries and from all sources.
        """
        heats = np.array(self._heats)
        largest = np.abs(np.column_stack([heats, self._stored])).max(1)
        return (np.array(self._stored) - heats.sum(1)) / np.where(largest > 0, largest, 1.0)

    def temperature(self, time: float | None = None) -> fem.Function:
        """Return the temperature of the body at a time.

        Args:
            time: the time; default the end of the run.

        Returns:
            Quadratic `Function` on `mesh`.

        Raises:
            InputError: a time outside the run.
        """
        T = fem.Function(self._body.space, name="temperature")
        T.x.array[: len(self._body.points)] = self._state_at(time)[0]
        T.x.scatter_forward()
        return T

    def at_points(self, points: Any, times: Any = None) -> np.ndarray:
        """Return temperatures of the body at points and times.

        Args:
            points: reference positions (R, Z), shape (n, 2), length, the same on all ranks.
            times: times; default `outputs`.

        Returns:
            Temperatures, shape (times, n).

        Raises:
            InputError: a point outside the body, or a time outside the run.
        """
        points = np.atleast_2d(np.asarray(points, dtype=float))
        reader = PointReader(self._body.space, points)
        return np.array([reader.read(self.temperature(t).x.array) for t in self._times_or_outputs(times)])

    def line_profile(self, times: Any = None, *, line: Any = None,
                     points: int = _LINE_POINTS) -> tuple[np.ndarray, np.ndarray]:
        """Return temperatures along a straight line through the body.

        Args:
            times: times; default `outputs`.
            line: reference positions (R, Z) of the two ends of the line, length. Default: from the first node of
                `bottom` to the first node of `top` (or from `inner` to `outer`).
            points: number of equidistant points on the line.

        Returns:
            Distances from the first end, shape (points,), length; temperatures, shape (times, points).

        Raises:
            InputError: a point outside the body, a time outside the run, or no default line.
        """
        first, last = np.array(self._default_line() if line is None else line, dtype=float).reshape(2, 2)
        s = np.linspace(0, 1, points)
        return s * float(np.hypot(*(last - first))), self.at_points(first + np.outer(s, last - first), times)

    def line_mean(self, times: Any = None, *, line: Any = None) -> np.ndarray:
        """Return the mean temperature along a straight line through the body, by Simpson's rule.

        Args:
            times: times; default `outputs`.
            line: reference positions (R, Z) of the two ends of the line, length. Default: from the first node of
                `bottom` to the first node of `top` (or from `inner` to `outer`).

        Returns:
            Temperatures, shape (times,).

        Raises:
            InputError: a point outside the body, a time outside the run, or no default line.
        """
        _, T = self.line_profile(times, line=line)
        weights = np.full(_LINE_POINTS, 2.0)
        weights[1::2], weights[0], weights[-1] = 4.0, 1.0, 1.0
        return T @ (weights / weights.sum())

    def hottest(self, time: float | None = None) -> Spot:
        """Return the node of highest temperature at a time.

        Args:
            time: the time; default the end of the run.

        Returns:
            Temperature and reference position of the node.

        Raises:
            InputError: a time outside the run.
        """
        return self._extreme(self._state_at(time)[0], 1)

    def coldest(self, time: float | None = None) -> Spot:
        """Return the node of lowest temperature at a time.

        Args:
            time: the time; default the end of the run.

        Returns:
            Temperature and reference position of the node.

        Raises:
            InputError: a time outside the run.
        """
        return self._extreme(self._state_at(time)[0], -1)

    def time_to_reach(self, low: float, high: float) -> Window:
        """Return the times at which the whole body has entered a range of temperatures, and a part of it leaves again.

        Args:
            low: lower bound of the range, in the unit of the run.
            high: upper bound of the range.

        Returns:
            The two times.

        Raises:
            InputError: `low` is not below `high`.
        """
        low, high = finite("time_to_reach: low", low), finite("time_to_reach: high", high)
        if not low < high:
            raise InputError(f"time_to_reach: low = {low!r}: must be below high = {high!r}")

        def excess(time):
            """Return the largest excess of a temperature over the range, degrees; negative if the body is inside it."""
            return max(low - self.coldest(time).temperature, self.hottest(time).temperature - high)
        reached = self._first_time_inside(excess, self._times)
        if reached is None:
            return Window(None, None)
        later = [t for t in self._times if t > reached]
        return Window(reached, self._first_time_inside(lambda t: -excess(t), later, from_time=reached))

    def tool_profile(self, on: str, point: Any, time: float | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Return temperatures along the depth of a conducting tool, below the contact node nearest to a point.

        Args:
            on: name of the boundary in contact with the tool.
            point: reference position (R, Z) of the point, length.
            time: the time; default the end of the run.

        Returns:
            Depths from the face of the tool, shape (m,), length; temperatures, shape (m,).

        Raises:
            InputError: no conducting tool is in contact with the boundary, or a time outside the run.
        """
        conducting = {t.on: k for k, t in enumerate(self._body.tool_contacts) if t.conducts}
        check_name("tool_profile: conducting tool on boundary", on, conducting)
        number = conducting[on]
        touch, excess = self._body.tool_contacts[number], self._state_at(time)[1 + number]
        away = np.hypot(*(touch.points - np.asarray(point, dtype=float)).T)
        mine = (away.min(initial=np.inf), self._comm.rank)
        nearest = min(self._comm.allgather(mine))
        below = self._comm.bcast(excess[np.argmin(away)] if nearest == mine else None, root=nearest[1])
        return touch.depths, touch.back + np.append(below, 0.0)

    def to_csv(self, file: Any) -> None:
        """Write a CSV file with one row per step (rank 0 writes).

        Columns are time, estimated error, coldest and hottest temperature, stored heat, and heat through each boundary.

        Args:
            file: path of the file.
        """
        header = ["time", f"estimated_error [{self.unit}]", f"coldest [{self.unit}]", f"hottest [{self.unit}]",
                  "heat_stored", *(f"heat of {name}" for name in self._unique_names())]
        rows = [[t, e, self._extreme(state[0], -1).temperature, self._extreme(state[0], 1).temperature, stored, *heats]
                for t, e, state, stored, heats in zip(self._times, self._errors, self.states, self._stored,
                                                      self._heats)]
        files.write_rows(file, header, rows, self._comm)

    def field_to_csv(self, file: Any, time: float | None = None) -> None:
        """Write the nodal temperatures at a time as a CSV file with columns R, Z, T (rank 0 writes).

        `heat(start=...)` reads the file.

        Args:
            file: path of the file.
            time: the time; default the end of the run.
        """
        table = np.column_stack([self._body.points, self._state_at(time)[0]])
        rows = gathered(self._comm, table)
        files.write_rows(file, ["R", "Z", "T"], rows.tolist(), self._comm)

    def plot_line_profile(self, times: Any = None, *, line: Any = None, scale: float = 1.0, axes: Any = None,
                          **style: Any) -> Any:
        """Draw the temperature along a line through the body, one curve per time.

        Args:
            times: times; default `outputs`.
            line: reference positions (R, Z) of the two ends of the line, length. Default: from the first node of
                `bottom` to the first node of `top` (or from `inner` to `outer`).
            scale: factor of the distances on the axis, such as 1000 for mm.
            axes: matplotlib axes; default a new figure.
            style: options of the matplotlib lines.

        Returns:
            The matplotlib axes.
        """
        from ...figures import new_axes
        axes = new_axes() if axes is None else axes
        chosen = self._times_or_outputs(times)
        distance, T = self.line_profile(chosen, line=line)
        for k, (t, row) in enumerate(zip(chosen, T)):
            shade = {"color": _colour(k, len(chosen))} | style
            axes.plot(scale * distance, row, **{"label": f"t = {t:g}"} | shade)
        axes.set(xlabel="distance through the thickness", ylabel=f"temperature, {DEGREES[self.unit]}")
        return axes

    def _unique_names(self) -> list[str]:
        """Return the names of boundaries and sources of heat; equal names are numbered."""
        names = self._body.names
        return [n if names.count(n) == 1 else f"{n} {names[: k + 1].count(n)}" for k, n in enumerate(names)]

    def _times_or_outputs(self, times: Any) -> np.ndarray:
        """Return times as an array, shape (k,); the output times if `times` is None."""
        return self.outputs if times is None else np.atleast_1d(np.asarray(times, dtype=float))

    def _default_line(self) -> list[np.ndarray]:
        """Return the reference positions, (2,) each, of the ends of the default line; InputError if it has none."""
        for low, high in (("bottom", "top"), ("inner", "outer")):
            if {low, high} <= set(self.mesh.boundaries):
                return [self.mesh.line_of(low)[0], self.mesh.line_of(high)[0]]
        raise InputError(f"a line through the body: the mesh has no faces 'bottom' and 'top', only"
                         f" {', '.join(map(repr, self.mesh.boundaries))}: give its ends as line=((R, Z), (R, Z))")

    def _state_at(self, time: float | None) -> list[np.ndarray]:
        """Return the temperatures at a time, None: the end, by Hermite's cubic; outside the run: InputError."""
        times = self._times
        t = times[-1] if time is None else finite("time", time)
        near = 1e-12 * times[-1]
        if not -near <= t <= times[-1] + near:
            raise InputError(f"time = {t!r}: must be from 0 to {times[-1]:g}")
        k = int(np.argmin(np.abs(np.array(times) - t)))
        if abs(times[k] - t) <= near:
            return self.states[k]
        k = int(np.searchsorted(times, t)) - 1
        dt = times[k + 1] - times[k]
        s = (t - times[k]) / dt
        a, b, slope_a, slope_b = self.states[k], self.states[k + 1], self._slope(k), self._slope(k + 1)
        return [(1 + 2 * s) * (1 - s) ** 2 * va + s**2 * (3 - 2 * s) * vb + dt * s * (1 - s) * ((1 - s) * da - s * db)
                for va, vb, da, db in zip(a, b, slope_a, slope_b)]

    def _slope(self, k: int) -> list[np.ndarray]:
        """Return time derivatives in state k, degrees per time, of the parabola of three states or the chord of two."""
        i = min(max(k, 1), len(self._times) - 2)
        if i < 1:
            return [(b - a) / (self._times[1] - self._times[0]) for a, b in zip(*self.states[:2])]
        t0, t1, t2 = (self._times[j] - self._times[k] for j in (i - 1, i, i + 1))
        weights = (-(t1 + t2) / ((t0 - t1) * (t0 - t2)), -(t0 + t2) / ((t1 - t0) * (t1 - t2)),
                   -(t0 + t1) / ((t2 - t0) * (t2 - t1)))
        return [sum(w * v for w, v in zip(weights, parts)) for parts in zip(*self.states[i - 1: i + 2])]

    def _extreme(self, T: np.ndarray, sign: int) -> Spot:
        """Return the node of the largest (sign 1) or smallest (sign -1) of temperatures T, shape (n,); all ranks."""
        k = int(np.argmax(sign * T)) if len(T) else -1
        mine = (sign * T[k], *self._body.points[k].tolist()) if len(T) else (-np.inf, 0.0, 0.0)
        value, R, Z = max(self._comm.allgather(mine))
        return Spot(float(sign * value), R, Z)

    def _first_time_inside(self, excess: Any, times: list[float], from_time: float | None = None) -> float | None:
        """Return the first time of `excess` <= 0 among `times`, from `from_time` on, or the root before; else None."""
        from scipy.optimize import brentq
        before = from_time
        for t in times:
            if excess(t) <= 0:
                return t if before is None or excess(before) <= 0 else float(brentq(excess, before, t, xtol=1e-9 * t))
            before = t
        return None


def _colour(k: int, n: int) -> Any:
    """Return the colour (RGBA) of curve k of n curves, k from 0."""
    from matplotlib import colormaps
    return colormaps["viridis"](0.9 * (1 - k / max(n - 1, 1)))
