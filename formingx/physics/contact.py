r"""Contact of a face of the body with a rigid tool: penalty, regularised ramp, and three laws of friction.

Song (1993), eqs. (5.7) to (5.14), per unit reference area, at a point of signed distance d (positive inside the tool).
The normal traction is

.. math:: N = k F(d), \qquad F(d) = \begin{cases} 0 & d \le -\theta \\ (d + \theta)^2 / (4\theta) & |d| < \theta \\
          d & d \ge \theta, \end{cases}

the tangential traction for stick and for Coulomb's law

.. math:: T_{stick} = k F'(d)\, g, \qquad T_{Coulomb} = \mu N \min(|g| / g_s, 1)\, \operatorname{sign} g.

The elastic slip g is the tangential motion since gap closure, minus the sliding. Stick is mu = inf, frictionless
contact mu = 0. A point that was open at the last accepted state slips from its gap closure on. The tangent of the path
predicts the closure. A point whose gap closes at the end of the step, or later, carries no shear
until then.

Coulomb's law is regularised: points slide after the same small elastic slip g_s at every pressure. Their stiffness
therefore grows with the pressure (Wriggers, Computational Contact Mechanics, 2006; the elastic stick of the Abaqus
Theory Manual, section 5.2.3). Sliding dissipates energy. Elastic slip has no energy while N changes. Slip under N1 and
back under N2 gains at most mu (N2 - N1) g_s/2 per area, which vanishes with g_s.

For a tool from which the body does not separate, a point that has been in contact has F(d) = d + theta of either sign.
The other points have max(d + theta, 0), which is continuous at gap closure.

Contact acts at nodes or at Gauss points of the facets. The nodes of six-node triangles are the points of the
Gauss-Lobatto rule on a facet (exact for the lumped area). History variables belong to the same points.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import InputError, count, instance, pair, positive, triple
from ..tools.shapes import Nearest
from ..tools.tool import PlaneTool
from ..values.temperature import FunctionOfTemperature
from .contact_arguments import coefficient, contact_points
from .contact_law import ContactLaw, Motion, NormalLaw, Touch, Tractions, outer
from .part import Part

_STICKS = 100.0
"""Coefficient of friction above which a point counts as sticking."""

_ROUGH = 1000.0
"""T/N above which a sticking point slides if it may separate: without pressure it carries no shear traction."""

_ELASTIC_SLIP = 1e-3
"""g_s over thickness: small enough for the forces (tests/test_compression.py), large enough for Newton's method."""

_SLIDES, _STICK, _BONDED = (2e5, 1e-7), (2e5, 1e-5), (2e4, 1e-5)
"""Penalty and ramp of sliding points, of sticking points until pulled off, and of what never separates, where
stiffer costs iterations."""

_RAMP_EDGE = 1e-7
"""Distance from the outer edge of the ramp, over theta, that is negligible."""


class Contact(Part):
    """Contact of a face of the body with a rigid tool.

    Args:
        on: name of the boundary that faces the tool.
        tool: a `Tool`, see `formingx.tools`; for a sheet in three dimensions `solid`, `box`, `revolved` or `extruded`.
        friction: "stick" (no sliding), "none", or the coefficient mu of Coulomb's law (5.9), 0 or larger. A coefficient
            that depends on the temperature of the body is a `table` {T: mu} or the result of `of_temperature`. Its
            value is taken at the last accepted state.
        penalty: k over shear modulus / thickness of the sheet; default 2e5, with separates=False 2e4.
        ramp: theta over thickness of the sheet; default 1e-7 where points slide, 1e-5 where they stick.
        elastic_slip: g_s over thickness of the sheet: elastic motion of a point before it slides.
        separates: False: points that have been in contact stay in contact, with "stick" or "none". Examples are a tacky
            sheet, or a plug to which the sheet is bonded. The default is True. In three dimensions the default for
            "stick" is False: a point stays in contact until a stage makes the tool inactive. There True lets points in
            tension separate, for materials that do not relax.
        nodes_per_step: number of nodes that come into contact in one step (an element edge has two); in three
            dimensions a percentage of all nodes, default 1. The results of stick, friction and heat exchange depend on
            the time of gap closure. None: up to 5 % of the nodes where points stick, and on faces that slide beside
            them. Their gap closures are predicted in order. Elsewhere one node with friction or heat.
        present_area: True: the penalty refers to area and wall at the beginning of a step instead of the reference
            configuration. A sheet that is drawn 20 times thinner then penetrates as little as an undeformed one. Only
            without friction. The penetration then depends on the steps.
        points: "nodes" of the face, or the number of Gauss points of each facet. Gauss points separate one by one,
            which is smoother where a sheet slides over an edge.
        direction: motion of the tool per unit of travel, (r, z), in three dimensions (x, y, z); the travel is a control
            of the run. None: the tool is fixed.
        name: name in a process and in columns.

    Raises:
        InputError: an argument that is not allowed.

    >>> plug = fx.Contact("top", fx.tools.cylinder(radius=20.0, z=2.0, fillet=4.0), 0.3, direction=(0, -1), name="plug")
    >>> plug.driven
    True
    """

    quantity = "travel"
    described = ("mu",)
    on: str
    tool: Any
    mu: Any

    def __init__(self, on: str, tool: Any, friction: Any = "stick", *, penalty: float | None = None,
                 ramp: float | None = None, elastic_slip: float = _ELASTIC_SLIP, separates: bool | None = None,
                 nodes_per_step: int | None = None, points: str | int = "nodes",
                 present_area: bool = False, direction: tuple[float, ...] | None = None, name: str | None = None):
        self.name, name = name, f"Contact({on!r})"
        if isinstance(tool, type) or not hasattr(tool, "signed_distance"):
            raise InputError(f"{name}: tool = {tool!r}: must be a tool from formingx.tools")
        self.on, self.tool, self.friction = instance("Contact: on", on, str, "the name of a boundary"), tool, friction
        self.mu = coefficient(f"{name}: friction", friction)
        three_d = self.lagged
        usually = not three_d or not self.sticks
        self.separates = instance(f"{name}: separates", usually if separates is None else separates, bool,
                                  "True or False")
        usual = _BONDED if three_d or not self.separates else _STICK if self.sticks else _SLIDES
        self.penalty = positive(f"{name}: penalty", usual[0] if penalty is None else penalty)
        self.ramp = positive(f"{name}: ramp", usual[1] if ramp is None else ramp)
        self.elastic_slip = positive(f"{name}: elastic_slip", elastic_slip)
        if not self.separates and not three_d and (self.friction_by_temperature or 0 < self.mu < math.inf):
            raise InputError(f"{name}: friction = {friction!r} with separates=False: what pulls at the tool has no"
                             f" Coulomb friction; use 'stick' or 'none'")
        self.nodes_per_step = None if nodes_per_step is None else count(f"{name}: nodes_per_step", nodes_per_step)
        self.points = contact_points(f"{name}: points", points)
        self.present_area = instance(f"{name}: present_area", present_area, bool, "True or False")
        if present_area and (self.friction_by_temperature or self.mu > 0 or not self.separates):
            raise InputError(f"{name}: friction = {friction!r}, separates = {self.separates!r} with present_area=True:"
                             f" what a point holds on to would change with its penalty; use 'none', or a larger"
                             f" penalty")
        numbers: Callable = pair if tool.components == 2 else triple
        self.direction = None if direction is None else numbers(f"{name}: direction", direction)
        if self.direction is not None and not any(self.direction):
            raise InputError(f"{name}: direction = {direction!r}: must name a direction, or be None")

    @property
    def driven(self) -> bool:
        """True if the run controls the motion of the tool."""
        return self.direction is not None

    @property
    def friction_by_temperature(self) -> bool:
        """True if friction depends on the temperature."""
        return isinstance(self.mu, FunctionOfTemperature)

    @property
    def sticks(self) -> bool:
        """True if points never slide, under "stick" and for mu of 100 or larger."""
        return not self.friction_by_temperature and self.mu >= _STICKS

    @property
    def way(self) -> np.ndarray:
        """Motion of the tool per unit of its travel, shape (components,); 0 if the tool is fixed."""
        return np.array(self.direction or (0.0,) * self.tool.components)

    @property
    def symmetric(self) -> bool:
        """True for contact without friction and history, which has an energy."""
        return not self.friction_by_temperature and self.mu == 0 and self.separates

    @property
    def lagged(self) -> bool:
        """True if points stick from the step after their gap closure (`LaggedStick`), on tools in three dimensions."""
        return self.tool.components == 3

    def shear_limit(self, pressure: np.ndarray, mu: np.ndarray | float) -> tuple[np.ndarray, np.ndarray | float]:
        r"""Return the shear stress at which points slide; the default is Coulomb's law.

        .. math:: \tau_{max} = \mu p

        A subclass can return another law, which must vanish without pressure and must not decrease with the pressure.
        It is not used for stick.

        Args:
            pressure: pressure p, shape (n,), stress.
            mu: coefficient of friction, shape () or (n,).

        Returns:
            Shear stress, shape (n,), stress; its derivative with respect to the pressure, shape () or (n,).
        """
        return mu * pressure, mu

    def friction_at(self, temperature: np.ndarray | None, clamped: bool = False) -> Any:
        """Return the coefficient of friction at temperatures.

        Args:
            temperature: temperatures at n points, shape (n,); not used for a constant coefficient.
            clamped: True to take, beyond an end of a table, the value at that end, as in a run.

        Returns:
            mu, a number, or the values at the points, shape (n,).

        Raises:
            InputError: mu has no value at a temperature, or a negative one.
        """
        if not self.friction_by_temperature:
            return self.mu
        if temperature is None:
            raise InputError(f"{self!r}: friction depends on the temperature: give Scene a temperature=...")
        try:
            mu = (self.mu.clamped if clamped else self.mu)(temperature)
        except InputError as error:
            raise InputError(f"Contact({self.on!r}): friction: {error}") from None
        for i in np.flatnonzero(mu < 0)[:1]:
            raise InputError(f"{self!r}: friction = {mu[i]:.6g} at a temperature of {temperature[i]:.6g}: must be at"
                             f" least 0")
        return mu

    def law(self, k: np.ndarray | float, thickness: float, points: np.ndarray,
            temperature: np.ndarray | None = None) -> ContactLaw:
        """Return the contact law at points of the face.

        Args:
            k: penalty, shape () or (n,), stress/length.
            thickness: thickness of the sheet, length.
            points: reference positions, shape (n, 2), length.
            temperature: temperature of the body at the points, shape (n,), if friction depends on it.

        Returns:
            The law.
        """
        theta, elastic_slip = self.ramp * thickness, self.elastic_slip * thickness
        if self.lagged:
            return self.tool.contact_law(self, k, thickness)
        edge = (1 - _RAMP_EDGE * self.separates) * theta
        shift = np.maximum(self.tool.signed_distance(points) + edge, 0.0)
        mu = self.friction_at(temperature, clamped=True)
        shear_limit: Callable | None = self.shear_limit
        if self.separates and isinstance(mu, float) and mu == math.inf:
            mu, shear_limit = _ROUGH, None
        return Law(self.tool, mu, k, theta, elastic_slip, shift, not self.separates, shear_limit)

    def __repr__(self) -> str:
        return f"Contact({self.on!r}, {self.tool!r}, {self.friction!r})"


class Law(NormalLaw):
    """The `ContactLaw` of this module: a penalty with a ramp, and friction.

    Args:
        tool, theta, shift: see `NormalLaw`.
        mu: coefficient of friction, a number, or one for each point, shape (n,).
        k: penalty, stress/length, likewise.
        elastic_slip: g_s, length, not used by stick.
        pulls: True if points in contact never separate.
        shear_limit: see `Contact.shear_limit`; None: Coulomb's mu p.
    """

    predictable = True

    def __init__(self, tool: PlaneTool, mu: np.ndarray | float, k: np.ndarray | float, theta: float,
                 elastic_slip: float, shift: np.ndarray | float = 0.0, pulls: bool = False,
                 shear_limit: Callable | None = None):
        super().__init__(tool, k, theta, shift)
        self.shear_limit = shear_limit or (lambda pressure, mu: (mu * pressure, mu))
        self.elastic_slip, self.pulls = elastic_slip, pulls
        self._set_friction(mu)
        self._slid: tuple[Nearest, Touch, tuple] | None = None      # slip of the last nearest points and history

    def with_friction(self, mu: np.ndarray | float) -> Law:
        """Return the same law with other coefficients of friction."""
        law = self._with()
        law._set_friction(mu)
        return law

    def _set_friction(self, mu: np.ndarray | float) -> None:
        self.mu, self._slides = mu, bool(np.all(np.isfinite(mu)))
        self.has_friction = np.ndim(mu) > 0 or bool(mu > 0)
        self.remembers = self.has_friction or self.pulls

    def touching(self, x: np.ndarray, old: Touch | None) -> np.ndarray:
        """Return a mask of the points at x that touch or stick, shape (n,)."""
        return (self.distance(x) > -self.theta) | self._held(old)

    def _held(self, old: Touch | None) -> np.ndarray | bool:
        """Return a mask of the points that cannot separate, shape (n,)."""
        return False if not self.pulls or old is None else old.distance > -self.theta

    def ramp(self, d: np.ndarray, held: np.ndarray | bool = False) -> tuple[np.ndarray, np.ndarray]:
        """F(d), eq. (5.13) if the body separates from the tool, and its derivative."""
        if self.pulls:
            slope = np.where(held | (d > -self.theta), 1.0, 0.0)
            return slope * (d + self.theta), slope
        slope = np.minimum(np.maximum((d + self.theta) / (2 * self.theta), 0.0), 1.0)      # np.clip is slow
        return np.where(d < self.theta, self.theta * slope**2, d), slope

    def depth(self, pressure: np.ndarray) -> np.ndarray:
        """Return the distance at which the normal traction is a pressure, stress."""
        over = pressure / (self.k * self.theta)
        return self.theta * ((np.where(over > 1, over, 2 * np.sqrt(over) - 1)) if not self.pulls else over - 1)

    @property
    def sticks(self) -> np.ndarray | bool:
        """See `ContactLaw.sticks`."""
        return self.mu >= _STICKS

    @property
    def friction(self) -> np.ndarray:
        """T/N of a point that slides under next to no pressure, shape () or (n,); infinite: it sticks."""
        sticks = np.asarray(self.mu >= _STICKS)
        grows = self.shear_limit(np.zeros(np.shape(self.mu)), np.where(sticks, 0.0, self.mu))[1]
        return np.where(sticks, np.inf, grows)

    def energy(self, x: np.ndarray, old: Touch | None = None) -> np.ndarray:
        """Return the energy of the normal traction, see `ContactLaw`."""
        d, theta = self.distance(x), self.theta
        if self.pulls:
            return self.k * np.where(self._held(old) | (d > -theta), (d + theta) ** 2 / 2, 0.0)
        inside = np.clip(d + theta, 0.0, 2 * theta)
        return self.k * np.where(d < theta, inside**3 / (12 * theta), d**2 / 2 + theta**2 / 6)

    def start(self, x: np.ndarray) -> Touch:
        """Return the initial history variables of points at x."""
        d = self.distance(x)
        if self.pulls:                                      # at the outer edge of the ramp it sticks, free of stress
            d = np.where(np.abs(d / self.theta + 1) < _RAMP_EDGE, -(1 - _RAMP_EDGE) * self.theta, d)
        return _touch(x.copy(), d, np.zeros(len(x)))

    def tractions(self, x: np.ndarray, old: Touch | None, sense: np.ndarray | None = None,
                  expected: Motion | None = None) -> Tractions:
        """Compute the tractions at points x, shape (n, 2), with the history variables `old` (not used without
        friction).

        `expected`: where to linearise the law, at the points if None. Newton's method needs the values that the
        iteration before predicted: tractions as unknowns of their own would be those. Taken from the points, the
        curvature of tool and motion, times a stiff penalty, would drown them.

        `sense`: sense of sliding in the iteration before. A point whose sense would reverse sticks for this one
        iteration: Newton's method would send it to and fro across the narrow range of stick.
        """
        near, k = self.nearest(x), self.k
        d, n, t, bend = near.distance, near.normal, near.tangent, near.curvature
        at = d if expected is None else expected.distance
        held = self._held(old)
        zero: np.ndarray = np.zeros(len(x))
        if at.max(initial=-np.inf) <= -self.theta and not np.any(held):         # no point touches
            return Tractions(np.zeros(x.shape), zero, zero, zero, lambda: np.zeros((*x.shape, x.shape[1])),
                             lambda: _touch(x, d, zero))
        F, slope = self.ramp(at, held)
        pressed, ahead = k * F, d - at
        N = pressed + k * slope * ahead
        force = N[:, None] * n
        kept_at = np.where(held, np.maximum(d, 0.0), d) if self.remembers else d            # it stays in contact
        if not self.has_friction:
            return Tractions(force, N, zero, zero, lambda: outer(n, (k * slope)[:, None] * n)
                             + outer(t, (pressed * bend)[:, None] * t), lambda: _touch(x, kept_at, zero))
        assert old is not None
        g, dg = self._slip(x, near, t, old)
        predicted = g if expected is None else expected.slip
        s, rising = self._resistance(at, pressed, slope)
        T, sliding = s * g + rising * ahead * predicted, np.zeros(len(x), dtype=bool)
        sense_now, bent, grows = zero, T, 0.0
        if self._slides:
            trial = s * predicted
            turned = False if sense is None else np.sign(trial) * sense < 0
            limit, grows = self.shear_limit(pressed, self.mu)
            sliding = (np.abs(trial) > limit) & ~np.asarray(turned)
            sense_now = np.where(sliding, np.sign(trial), 0.0)
            T, bent = np.where(sliding, sense_now * (limit + grows * (N - pressed)), T), np.clip(T, -limit, limit)
        force = force + T[:, None] * t

        def stiffness() -> np.ndarray:
            stuck = s[:, None] * dg + (rising * predicted)[:, None] * n
            dT = np.where(sliding[:, None], (sense_now * grows * k * slope)[:, None] * n, stuck)
            return (outer(n, (k * slope)[:, None] * n - (bent * bend)[:, None] * t)
                    + outer(t, (pressed * bend)[:, None] * t + dT))

        def touch() -> Touch:
            kept = np.divide(T, s, out=zero.copy(), where=s > 0)
            kept *= 1 + 1e-9 * np.abs(sense_now)             # sliding points go on sliding, in spite of round-off
            return _touch(x, kept_at, kept)
        return Tractions(force, N, T, sense_now, stiffness, touch)

    def _resistance(self, d: np.ndarray, pressed: np.ndarray, slope: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Stiffness T/g of elastic slip at distances d, and its derivative by them, shape (n,) each."""
        sticks, k = self.sticks, self.k
        if np.ndim(sticks) == 0 and not sticks:
            limit, grows = self.shear_limit(pressed, self.mu)
            return limit / self.elastic_slip, grows / self.elastic_slip * k * slope
        rising = (np.abs(d) < self.theta) * (k / (2 * self.theta) * (not self.pulls))
        if np.ndim(sticks) == 0:
            return k * slope, rising
        limit, grows = self.shear_limit(pressed, np.where(sticks, 0.0, self.mu))
        return (np.where(sticks, k * slope, limit / self.elastic_slip),
                np.where(sticks, rising, grows / self.elastic_slip * k * slope))

    def stiffness_round(self, x: np.ndarray, old: Touch | None, radius: np.ndarray) -> np.ndarray:
        """Return the derivative of the traction round the axis by the motion there, shape (n,), stress/length.

        It is N n_r/r of the normal traction (r: `radius`, infinite in plane strain); for a sticking point the stiffness
        of the elastic slip is added.
        """
        turned, near, found = super().stiffness_round(x, old, radius), self.nearest(x), self.tractions(x, old)
        if not self.has_friction:
            return turned
        F, slope = self.ramp(near.distance, self._held(old))
        return turned + np.where(found.sense == 0, self._resistance(near.distance, self.k * F, slope)[0], 0.0)

    def motion(self, x: np.ndarray, old: Touch | None) -> Motion:
        """Return the distance and the slip of points x, shape (n, 2), and their gradients."""
        near = self.nearest(x)
        g, dg = (np.zeros(len(x)), 0 * x) if old is None else self._slip(x, near, near.tangent, old)
        return Motion(x, near.distance, near.normal, g, dg)

    def stiffness_ahead(self, x: np.ndarray, old: Touch | None, arrived: np.ndarray) -> np.ndarray:
        """Return the stiffness with points that have just touched (`arrived`), or are about to, pressed halfway into
        the ramp.

        At the outer edge of the ramp they have none, and the tangent of the path would let them slip where they will
        stick.
        """
        near, now = self.nearest(x), self.tractions(x, old)
        # a body may rest at the outer edge of the ramp
        about = np.abs(near.distance / self.theta + 1.025) < 0.025 + 2 * _RAMP_EDGE
        touching = (arrived | about) & (now.sense == 0)
        press = np.where(touching, np.maximum(-0.5 * self.theta - near.distance, 0.0), 0.0)
        if old is not None:
            distance = np.where(self._held(old), old.distance, near.distance + press)
            old = old._replace(distance=distance, position=x)
        pressed = self.tractions(x + press[:, None] * near.normal, old)
        return np.where((press > 0)[:, None, None], pressed.stiffness, now.stiffness)

    def _slip(self, x: np.ndarray, near: Nearest, tangent: np.ndarray, old: Touch) -> tuple[np.ndarray, np.ndarray]:
        """Return the elastic slip g of points that stick, shape (n,), and its gradient, shape (n, 2); computed once."""
        if self._slid is not None and self._slid[0] is near and self._slid[1] is old:
            return self._slid[2]
        touched = old.distance > -self.theta
        motion = x - np.where(touched[:, None], old.position, old.arrival)
        slips = ~np.isnan(motion[:, 0])
        motion = np.where(slips[:, None], motion, 0.0)
        along = np.einsum("ni,ni->n", tangent, motion)
        across = np.einsum("ni,ni->n", near.normal, motion)
        found = old.slip + along, tangent * (slips * (1 - near.curvature * across))[:, None]
        self._slid = near, old, found
        return found


def _touch(x: np.ndarray, d: np.ndarray, slip: np.ndarray) -> Touch:
    return Touch(x, d, slip, x)
