"""Contact of a face of the body with a rigid tool: penalty, regularised ramp, and three laws of friction.

`formingx.physics.contact_law.Law` states the tractions, per unit reference area. The elastic slip g is the tangential
motion since gap closure, minus the sliding. Stick is mu = inf, frictionless contact mu = 0. For a point that was open
at the last accepted state, the slip counts from the position of its gap closure. The tangent of the path predicts this
position. A point whose gap closes at the end of the step, or later, carries no shear until then.

Unlike Song (1993), eq. (5.9), Coulomb's law is regularised: points slide after the same small elastic slip g_s at every
pressure. Their stiffness therefore grows with the pressure (Wriggers, Computational Contact Mechanics, 2006; the
elastic stick of the Abaqus Theory Manual, section 5.2.3). Sliding dissipates energy. Elastic slip has no energy while N
changes. Slip under N1 and back under N2 gains at most mu (N2 - N1) g_s/2 per area, which vanishes with g_s.

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

from ..errors import InputError, check_type, pair, positive, triple
from ..values.temperature import FunctionOfTemperature
from .contact_arguments import closures, coefficient, contact_points
from .contact_law import RAMP_EDGE, STICKS, ContactLaw, Law
from .part import ScenePart

_STICKING_RATIO = 1000.0
"""Ratio T/N above which a sticking point that may separate slides: it carries no shear traction without pressure."""

_ELASTIC_SLIP = 1e-3
"""Elastic slip g_s over thickness: small for accurate forces (tests/test_compression.py), large for Newton's method."""

_SLIDES, _STICK, _BONDED = (2e5, 1e-7), (2e5, 1e-5), (2e4, 1e-5)
"""Default (penalty, ramp) of sliding points, of sticking points that separate, and of points that never separate.

The last pair also belongs to every tool in three dimensions; a stiffer penalty would cost iterations there."""

_THIN = 0.01
"""Thickness over largest extent of a sheet in three dimensions, below which this extent scales contact."""


class Contact(ScenePart):
    r"""Contact of a boundary of the body with a rigid tool, by a penalty k (Song 1993, eqs. (5.7) and (5.13)).

    .. math:: N = k F(d), \qquad F = (d + \theta)^2 / (4\theta) \text{ for } |d| < \theta, \quad \max(d, 0) \text{ else}

    N is the normal traction per reference area and d the signed distance from a plane tool, positive inside. The
    contact ramp :math:`|d| < \theta` regularises the onset of contact.

    Args:
        on: name of the boundary that faces the tool.
        tool: a `Tool`, see `formingx.tools`; for a sheet in three dimensions `solid`, `box`, `revolved` or `extruded`.
        friction: "stick" (no sliding), "none", or the coefficient mu of Coulomb's law (5.9), 0 or larger. A coefficient
            that depends on the temperature of the body is a `table` {T: mu} or the result of `of_temperature`. The
            temperature is that at the last accepted state.
        penalty: penalty k divided by shear modulus / thickness of the sheet; default 2e5; 2e4 with
            separates=False and in three dimensions.
        ramp: half-width theta of the contact ramp, divided by the thickness of the sheet. The default is 1e-7 where
            points slide, 1e-5 where they stick and in three dimensions.
        elastic_slip: elastic slip g_s, the tangential motion of a point before it slides, divided by the thickness of
            the sheet. A sheet in three dimensions that is thinner than 0.01 times its extent L has the ramp and the
            slip of the thickness 0.01 L, and a penalty so soft that its penetration over L is that of this thickness.
        separates: True: points under tension separate from the tool. False: points that have been in contact stay in
            contact, until a stage of a process makes the tool inactive. None: True, except for "stick" in three
            dimensions. False is for "stick", and in a section for "none", such as a tacky sheet or a plug to which the
            sheet is bonded. True with "stick" in three dimensions is for materials that do not relax.
        nodes_per_step: largest number of nodes that come into contact in one step, or their share of the nodes of the
            face, below 1. The results of stick, friction and heat exchange depend on the time of contact. In three
            dimensions None means the share 0.01. In a section None means 1 node; an element edge has two. If any face
            sticks, None means the share 0.05 on each face with stick or friction, in the predicted order of the gap
            closures. Without stick, friction, bond and heat exchange ten times more nodes come into contact.
        present_area: True: the penalty refers to area and wall thickness at the beginning of a step, instead of the
            reference configuration. A sheet that is drawn 20 times thinner then penetrates as little as an undeformed
            one. Only without friction. The penetration then depends on the steps.
        points: "nodes" of the face, or the number of Gauss points of each facet. Gauss points separate one by one,
            which is smoother where a sheet slides over an edge.
        direction: motion of the tool per unit of travel, (r, z), in three dimensions (x, y, z). The travel is a load
            parameter (control) of the run. None: the tool is fixed.
        name: name of the contact in the stages of a `Process` and in the column names of results.

    Attributes:
        driven: True if the tool moves: its travel is then a load parameter (control) of the run.
        friction_by_temperature: True if the coefficient of friction depends on the temperature of the body.
        sticks: True if points in contact never slide: with "stick", and for mu of 100 or larger.
        separates: the argument `separates`, or its value for None.
        lagged: True for tools in three dimensions. A point whose gap closes in a step is then in contact from the next
            step on.
        max_closures: `nodes_per_step`, or its value for None.

    Raises:
        InputError: an argument is not allowed.

    >>> plug = fx.Contact("top", fx.tools.cylinder(radius=20.0, z=2.0, fillet=4.0), 0.3, direction=(0, -1), name="plug")
    >>> plug.driven
    True
    """

    quantity = "travel"
    described = ("mu", "driven", "friction_by_temperature", "sticks", "lagged", "max_closures")
    on: str
    tool: Any
    mu: Any

    def __init__(self, on: str, tool: Any, friction: Any = "stick", *, penalty: float | None = None,
                 ramp: float | None = None, elastic_slip: float = _ELASTIC_SLIP, separates: bool | None = None,
                 nodes_per_step: float | None = None, points: str | int = "nodes",
                 present_area: bool = False, direction: tuple[float, ...] | None = None, name: str | None = None):
        self.name, name = name, f"Contact({on!r})"
        if isinstance(tool, type) or not hasattr(tool, "signed_distance"):
            raise InputError(f"{name}: tool = {tool!r}: must be a tool from formingx.tools")
        self.on, self.tool, self.friction = check_type("Contact: on", on, str, "the name of a boundary"), tool, friction
        self.mu = coefficient(f"{name}: friction", friction)
        self.friction_by_temperature = isinstance(self.mu, FunctionOfTemperature)
        self.sticks = not self.friction_by_temperature and self.mu >= STICKS
        self.driven, self.lagged = direction is not None, tool.components == 3
        three_d = self.lagged
        usually = not (three_d and self.sticks)
        self.separates = check_type(f"{name}: separates", usually if separates is None else separates, bool,
                                    "True, False or None")
        usual = _BONDED if three_d or not self.separates else _STICK if self.sticks else _SLIDES
        self.penalty = positive(f"{name}: penalty", usual[0] if penalty is None else penalty)
        self.ramp = positive(f"{name}: ramp", usual[1] if ramp is None else ramp)
        self.elastic_slip = positive(f"{name}: elastic_slip", elastic_slip)
        if not self.separates and not three_d and (self.friction_by_temperature or 0 < self.mu < math.inf):
            raise InputError(f"{name}: friction = {friction!r} with separates=False: a point that pulls at the tool has"
                             f" no Coulomb friction; use 'stick' or 'none'")
        self.nodes_per_step = closures(f"{name}: nodes_per_step", nodes_per_step)
        self.max_closures = self.nodes_per_step or (0.01 if three_d else 1)
        self.points = contact_points(f"{name}: points", points)
        self.present_area = check_type(f"{name}: present_area", present_area, bool, "True or False")
        if present_area and (self.friction_by_temperature or self.mu > 0 or not self.separates):
            raise InputError(f"{name}: friction = {friction!r}, separates = {self.separates!r} with present_area=True:"
                             f" the traction of a sticking or bonded point would change with its penalty; use 'none',"
                             f" or a larger penalty")
        numbers: Callable = pair if tool.components == 2 else triple
        self.direction = None if direction is None else numbers(f"{name}: direction", direction)
        if self.direction is not None and not any(self.direction):
            raise InputError(f"{name}: direction = {direction!r}: must name a direction, or be None")

    @property
    def label(self) -> str:
        """Name of the contact for messages and tables: `name`, or without one the boundary `on`."""
        return self.name or self.on

    @property
    def travel_vector(self) -> np.ndarray:
        """Displacement of the tool per unit of its travel, shape (components,); 0 if the tool is fixed."""
        return np.array(self.direction or (0.0,) * self.tool.components)

    @property
    def symmetric(self) -> bool:
        """True if the contact stiffness is symmetric: contact without friction and history, which has an energy."""
        return not self.friction_by_temperature and self.mu == 0 and self.separates

    def shear_limit(self, pressure: np.ndarray, mu: np.ndarray | float) -> tuple[np.ndarray, np.ndarray | float]:
        r"""Return the shear stress at which points slide; the default is Coulomb's law.

        .. math:: \tau_{max} = \mu p

        A subclass can return another shear stress. It must vanish without pressure and must not decrease with the
        pressure. With "stick" this method is not used.

        Args:
            pressure: pressure p, shape (n,), stress.
            mu: coefficient of friction, shape () or (n,).

        Returns:
            Shear stress, shape (n,), stress; its derivative with respect to the pressure, shape () or (n,).
        """
        return mu * pressure, mu

    def friction_at(self, temperature: np.ndarray | None, clamped: bool = False) -> Any:
        """Return the coefficient of friction mu at given temperatures of the body.

        Args:
            temperature: temperatures at n points, shape (n,); not used for a constant coefficient.
            clamped: True: beyond an end of a table mu has the value at that end, as in a run. False: this is an error.

        Returns:
            mu, a number, or the values at the points, shape (n,).

        Raises:
            InputError: mu has no value or a negative value at a temperature, or depends on a temperature that is None.
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

    def reference_length(self, thickness: float, extent: float) -> float:
        """Return the length to which penalty, ramp and elastic slip refer: the thickness of the body.

        In three dimensions it is at least a hundredth of the largest extent of the sheet, a membrane, whose deformation
        does not depend on the thickness.
        """
        return max(thickness, _THIN * extent) if self.lagged else thickness

    def law(self, k: np.ndarray | float, thickness: float, points: np.ndarray,
            temperature: np.ndarray | None = None) -> ContactLaw:
        """Return the contact law of this contact: tractions at n contact points as a function of their positions.

        Args:
            k: penalty, shape () or (n,), stress/length.
            thickness: `reference_length` of the sheet, length; `ramp` and `elastic_slip` are multiplied by it.
            points: reference positions of the points, shape (n, 2), length; not used in three dimensions.
            temperature: temperature of the body at the points, shape (n,), if friction depends on the temperature.

        Returns:
            The contact law, for positions in the user's unit of length and tractions in the unit of stress.
        """
        theta, elastic_slip = self.ramp * thickness, self.elastic_slip * thickness
        if self.lagged:
            found: ContactLaw = self.tool.contact_law(self, k, thickness)
            return found.with_friction(self.friction_at(temperature, True)) if self.friction_by_temperature else found
        edge = (1 - RAMP_EDGE * self.separates) * theta
        shift = np.maximum(self.tool.signed_distance(points) + edge, 0.0)
        mu = self.friction_at(temperature, clamped=True)
        shear_limit = self.shear_limit if type(self).shear_limit is not Contact.shear_limit else None
        if self.separates and isinstance(mu, float) and mu == math.inf:
            mu, shear_limit = _STICKING_RATIO, None
        return Law(self.tool, mu, k, theta, elastic_slip, shift, not self.separates, shear_limit)

    def __repr__(self) -> str:
        return f"Contact({self.on!r}, {self.tool!r}, {self.friction!r})"
