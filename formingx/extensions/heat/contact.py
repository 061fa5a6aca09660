r"""Heat through a contact conductance into a tool of prescribed temperature, or into a conducting tool.

At each node of the face the flux into the body is

.. math:: q = h (T_{tool} - T)

with the conductance h. In a conducting tool heat flows in one dimension, along the depth y below each contact node. The
excess temperature w of the tool is its temperature minus the prescribed temperature of its back. It satisfies

.. math:: C \frac{\partial w}{\partial t} = k \frac{\partial^2 w}{\partial y^2}, \qquad
          -k \frac{\partial w}{\partial y} = -q \text{ at the face}, \qquad w = 0 \text{ at the back}

with the heat capacity C per volume and the conductivity k. In an implicit stage of a time step the temperatures below a
node respond linearly to q. The face of the tool has the temperature T_0 - z q. Without flux it would have T_0, and the
compliance z is the same for all nodes. So only the temperatures T of the body remain unknown:

.. math:: q = g (T_0 - T), \qquad g = \frac{h}{1 + z h}
"""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError, count, finite, non_negative, positive


class ConductingTool:
    """Tool wall that conducts heat along its depth, in one dimension, below each point in contact.

    Args:
        thickness: thickness of the wall, length.
        conductivity: thermal conductivity, heat per time, length and degree.
        heat_capacity: heat capacity per volume and degree (density times specific heat capacity).
        back: prescribed temperature of the back of the wall.
        start: initial temperature of the wall; default `back`.
        elements: number of quadratic elements through the thickness.
        finest: size of the element at the face over the thickness; sizes grow geometrically from the face.

    Raises:
        InputError: a number that is not allowed.

    >>> fx.ConductingTool(thickness=20.0, conductivity=0.05, heat_capacity=3.6e-3, back=40.0)      # steel: mm, W
    ConductingTool(thickness=20.0, conductivity=0.05, heat_capacity=0.0036, back=40.0)
    """

    def __init__(self, *, thickness: float, conductivity: float, heat_capacity: float, back: float,
                 start: float | None = None, elements: int = 40, finest: float = 1e-4):
        self.thickness = positive("ConductingTool: thickness", thickness)
        self.conductivity = positive("ConductingTool: conductivity", conductivity)
        self.heat_capacity = positive("ConductingTool: heat_capacity", heat_capacity)
        self.back = finite("ConductingTool: back", back)
        self.start = self.back if start is None else finite("ConductingTool: start", start)
        self.elements = count("ConductingTool: elements", elements)
        self.finest = positive("ConductingTool: finest", finest)
        if self.elements * self.finest > 1:
            raise InputError(f"ConductingTool: finest = {finest!r}: must be at most 1/elements = {1 / self.elements:g}")

    @property
    def depths(self) -> np.ndarray:
        """Distances of the nodes of the tool from its face, from 0 to `thickness`, shape (2 elements + 1,), length."""
        from scipy.optimize import brentq
        n, small = self.elements, self.finest
        ratio = 1.0
        if n * small < 1 - 1e-9:                               # small (1 + ratio + ... + ratio^(n - 1)) = 1
            ratio = brentq(lambda r: small * (r**n - 1) / (r - 1) - 1, 1 + 1e-12, (2 / small) ** (1 / max(n - 1, 1)))
        ends = np.concatenate([[0.0], np.cumsum(ratio ** np.arange(n))])
        return np.interp(np.arange(2 * n + 1) / 2, np.arange(n + 1), self.thickness * ends / ends[-1])

    def matrices(self) -> tuple[np.ndarray, np.ndarray]:
        """Return capacity and conductivity matrices along the depth, per contact area, without the node at the back.

        Returns:
            Capacity and conductivity matrix, shape (2 elements, 2 elements) each, for temperatures minus `back`.
        """
        y = self.depths
        M, K = np.zeros((2, len(y), len(y)))
        for e in range(0, len(y) - 1, 2):
            h, block = y[e + 2] - y[e], np.ix_(range(e, e + 3), range(e, e + 3))
            M[block] += self.heat_capacity * h / 30 * np.array([[4, 2, -1], [2, 16, 2], [-1, 2, 4]])
            K[block] += self.conductivity / (3 * h) * np.array([[7, -8, 1], [-8, 16, -8], [1, -8, 7]])
        return M[:-1, :-1], K[:-1, :-1]

    def __repr__(self) -> str:
        return (f"ConductingTool(thickness={self.thickness!r}, conductivity={self.conductivity!r},"
                f" heat_capacity={self.heat_capacity!r}, back={self.back!r})")


class ContactWithTool:
    """Face in complete contact with a tool from the start of a run.

    Args:
        on: name of the boundary.
        conductance: contact conductance, heat per time, area and degree.
        tool: a prescribed temperature, or a `ConductingTool`.

    Raises:
        InputError: a negative conductance, or a tool that is neither a number nor a `ConductingTool`.

    >>> fx.ContactWithTool("bottom", conductance=1e-3, tool=40.0)
    ContactWithTool('bottom', conductance=0.001, tool=40.0)
    """

    temperatures = ("tool",)

    def __init__(self, on: str, *, conductance: float, tool: float | ConductingTool):
        self.on = on
        self.conductance = non_negative(f"ContactWithTool({on!r}): conductance", conductance)
        self.tool = tool if isinstance(tool, ConductingTool) else finite(f"ContactWithTool({on!r}): tool", tool)

    def check(self, mesh: Any, absolute_zero: float) -> None:
        """Raise an InputError if a temperature of the tool is below absolute zero.

        Args:
            mesh: not used.
            absolute_zero: absolute zero in the unit of temperatures.

        Raises:
            InputError: the temperature of the tool, of its back or at its start is below absolute zero.
        """
        tool = self.tool
        for value in (tool.back, tool.start) if isinstance(tool, ConductingTool) else (tool,):
            if value < absolute_zero:
                raise InputError(f"{self!r}: temperature = {value!r}: must be at least {absolute_zero:g}")

    def __repr__(self) -> str:
        return f"ContactWithTool({self.on!r}, conductance={self.conductance!r}, tool={self.tool!r})"


class ToolResponse(NamedTuple):
    """Linear response of a tool to the flux q into the body, in an implicit stage of a time step.

    The tool has m nodes along its depth below each of n contact nodes. The flux is q = `conductance`
    (`face_temperature` - T) with the temperature T of the body. The tool's temperatures change in the stage by `change`
    - q `compliance`.

    Attributes:
        face_temperature: temperature of the face of the tool at the end of the stage if q were 0, shape (n,).
        conductance: conductance of contact and tool in series, heat per time, area and degree, shape (n,).
        change: change of the temperatures of the tool in the stage if q were 0, shape (n, m).
        compliance: decrease of the m temperatures below a contact node per unit of flux q, shape (m,).
    """

    face_temperature: np.ndarray
    conductance: np.ndarray
    change: np.ndarray
    compliance: np.ndarray


class HeatContact:
    """Contact nodes of a face with a tool, and the temperatures in the tool below them.

    The face has n locally owned nodes. Below each, the tool has m nodes along its depth, from its face to the last one
    before its back. Their excess temperatures over the back are differences to its temperature, shape (n, m). A tool of
    prescribed temperature has m = 0.

    Attributes:
        on: name of the boundary.
        dofs: local numbers of the nodes, shape (n,).
        points: reference positions of the nodes, shape (n, 2), length.
        area: tributary deformed area of each node over the heat capacity of the body, shape (n,); set by `Conduction`.
        conductance: contact conductance of each node, heat per time, area and degree, shape (n,); 0 without contact.
        back: temperature of the back of a conducting tool, or prescribed temperature of the tool.
        depths: distances of the m nodes along the depth, then of the back, from the face of the tool, shape (m + 1,),
            length; empty for a tool of prescribed temperature.
    """

    def __init__(self, contact: ContactWithTool, dofs: np.ndarray, points: np.ndarray):
        self.on, self.dofs, self.points = contact.on, dofs, points
        self.area = np.zeros(len(dofs))
        self.conductance = np.full(len(dofs), contact.conductance)
        tool = contact.tool
        if isinstance(tool, ConductingTool):
            self.back, self._initial_excess, self.depths = tool.back, tool.start - tool.back, tool.depths
            self._M, self._K = tool.matrices()
        else:
            self.back, self._initial_excess, self.depths = tool, 0.0, np.zeros(0)
            self._M, self._K = np.zeros((2, 0, 0))
        self._factor = lru_cache(maxsize=4)(self._factorise)

    @property
    def conducts(self) -> bool:
        """True if the tool is a `ConductingTool`."""
        return len(self._M) > 0

    def start(self) -> np.ndarray:
        """Return the initial excess temperatures of the tool over its back, shape (n, m), degrees."""
        return np.full((len(self.dofs), len(self._M)), self._initial_excess)

    def face(self, excess: np.ndarray) -> np.ndarray:
        """Return the temperature of the face of the tool, shape (n,), from excess temperatures, shape (n, m)."""
        return self.back + excess[:, 0] if self.conducts else np.full(len(self.dofs), self.back)

    def rates(self, excess: np.ndarray, T: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the flux into the body, shape (n,), and the rates of heat in the tool per contact area, shape (n, m).
        """
        q = self.conductance * (self.face(excess) - T)
        rate = -excess @ self._K
        rate[:, :1] -= q[:, None]
        return q, rate

    def response(self, excess: np.ndarray, known: np.ndarray, c: float, absolute: bool = True) -> ToolResponse:
        r"""Return the linear response of the tool to the flux q into the body, in an implicit stage of a time step.

        .. math:: M \Delta = k - c K (w + \Delta) - c q e_1

        M and K are the capacity and conductivity matrices along the depth of the tool, and Delta is the change of its
        excess temperatures w. The vector e_1 is 1 at the node on the face of the tool, else 0. Excess temperatures and
        known heats k per contact area have shape (n, m). With `absolute` False, temperatures are differences of two
        states, and the back has 0.
        """
        back = self.back if absolute else 0.0
        if not self.conducts:
            return ToolResponse(np.full(len(self.dofs), back), self.conductance, excess, np.zeros(0))
        inverse, compliance = self._factor(c)
        change = (known - c * excess @ self._K) @ inverse
        in_series = self.conductance / (1 + self.conductance * compliance[0])
        return ToolResponse(back + excess[:, 0] + change[:, 0], in_series, change, compliance)

    def flux_and_change(self, response: ToolResponse, known: np.ndarray, T: np.ndarray,
                        c: float) -> tuple[Any, Any, Any]:
        """Return flux, shape (n,), temperature changes and rates in the tool, both (n, m), after an implicit stage."""
        q = response.conductance * (response.face_temperature - T)
        change = response.change - np.outer(q, response.compliance)
        return q, change, (change @ self._M - known) / c

    def _factorise(self, c: float) -> tuple[np.ndarray, np.ndarray]:
        """Return (M + c K)^-1, shape (m, m), and its first column times c, shape (m,), along the depth of the tool."""
        inverse = np.linalg.inv(self._M + c * self._K)
        return inverse, c * inverse[:, 0]
