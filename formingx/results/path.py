"""Path of a run: its states, and their evaluation, pictures and files."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError, as_points, count
from ..figures import Axes
from ..findings import Finding, found_at, worst_first
from ..solve.state import State
from ..units import NONE, Units
from .evaluate.profile import Profile
from .evaluate.stress import StressField
from .reader import Reader, SectionReader
from .show.picture import Picture
from .states import States


class Path(States):
    """The states of a run, from the unloaded body to the target.

    Attributes:
        record: the solver's record of the run (`formingx.solve.record.Record`).
        pilot: the path of the first run, to which the mesh was adapted (`trace(..., adapt_mesh=True)`); else None.

    >>> path
    Path(9 states, to State('target', pressure=0.045088, pole_height=12, pole_stretch=2.26198, enclosed_volume=2895.08,
         strain_energy=85.9012, ...))
    >>> round(float(path["pressure"].max()), 4), path.last.kind
    (0.0451, 'target')
    """

    pilot: Path | None = None

    if TYPE_CHECKING:
        def __getattr__(self, name: str) -> Any:
            """Let type checkers accept the methods that extensions add (`formingx.results.extend`)."""

    def __repr__(self) -> str:
        return f"Path({len(self.states)} states{f', to {self.last!r}' if self.states else ''})"

    def findings(self) -> list[Finding]:
        """Return the findings of the checks before and after the run, worst first (`formingx.findings`); collective.

        A finding has a severity, a subject and a text. "serious": the results must not be used as they are. "warning":
        the scene may be another than was meant, or a result less exact than usual. "note": neither.

        >>> path.findings()
        []
        """
        return worst_first([*self.record.findings, *(found_at("end", self) if self.states else [])])

    def profile(self, state: State | None = None) -> Profile:
        """Deformed outline and thickness of a sheet at a state (default: the last)."""
        state = state or self.last
        return self._view(self.segment(state)).profiles.of(state)

    def stress(self, state: State | None = None) -> StressField:
        """Stresses and stretches at a state (default: the last), layer by layer."""
        self.section_only("stress", "look at path.wall(): stretches")
        state = state or self.last
        return self._view(self.segment(state)).stresses.of(state)

    def to_csv(self, file: Any, units: Units | None = None) -> None:
        """Write one row per state: stage (of a process), kind, iterations and every measure (rank 0 writes).

        units: a `formingx.Units`, for the header, as in "tool_force [N]"; in plane strain "tool_force [N/mm]".
        """
        from . import files
        files.write_path(self, file, units or NONE)

    def save(self, folder: Any) -> None:
        """Write every state to a checkpoint folder, to look at later or to continue from (`formingx.load`).

        Raises:
            InputError: the folder holds another run.
            OSError: it cannot be written.
        """
        from .files.checkpoint import Checkpoint
        kept = Checkpoint(folder, self)
        kept.write()
        kept.end("", self.findings())

    def to_vtk(self, file: Any, states: Any = None) -> None:
        """Write fields of states (default: the last) for ParaView, a time step each: `formingx.results.files.fields`.

        A file run-3.vtu for state 3 stands beside run.pvd, which lists the time steps; the time is the number of the
        state. The states of a remeshed run have their meshes.

        Args:
            file: its name ends in .pvd.
            states: a state, several in order, or "all".

        Raises:
            InputError: the name ends otherwise, or a state is not of the path.
            OSError: a file cannot be written.
        """
        from .files import fields
        fields.to_vtk(self, file, states)

    def animate(self, file: Any, frames: int = 60, seconds: float = 5.0, *, units: Units | None = None) -> Picture:
        """Draw the forming as a moving picture, a GIF or an MP4: the sheet's section and the loading curve (rank 0).

        Returns the file, which a notebook shows. units: a `formingx.Units`, for the labels.

        The frames are evenly spread over the process (`formingx.results.show.record.progress`), on the (cubic) path
        through the states; the last one stands for a second more.

        Raises:
            InputError: the name ends neither in .gif nor in .mp4, there is no ffmpeg to make an MP4, a number is not
                allowed, or the mesh is no sheet.
        """
        from .show import animation
        animation.animate(self, file, frames, seconds, units or NONE)
        return Picture(file)

    def report(self, file: Any = "report.html", title: str = "", failure: Any = None, *, units: Units | None = None,
               density: float | None = None, trim: Any = None) -> FilePath:
        """Write one HTML file that shows the run: the part, the process, curves, inputs, warnings (rank 0 writes).

        Returns where it is.

        Args:
            title: its heading.
            failure: the `ConvergenceError` that ended the run, if one did.
            units: a `formingx.Units`, for the labels; density, trim: see `Path.part`.

        Raises:
            InputError: plotly is not installed.
            OSError: the file cannot be written.
        """
        return self._reader.report(file, title, failure, units or NONE, density, trim)

    def plot(self, y: str, x: str, axes: Axes | None = None, **style: Any) -> Any:
        """Draw column `y` over column `x`; returns the matplotlib axes."""
        from .show import plots
        return plots.curve(self, y, x, axes, **style)

    def plot_convergence(self, axes: Axes | None = None) -> Any:
        """Draw the correction (3.5.1) of every Newton iteration of every state; returns the matplotlib axes."""
        from .show import plots
        return plots.convergence(self, axes)

    def view3d(self, file: Any, state: State | None = None, grid: float | None = None) -> Picture:
        """Draw the sheet of a state (default: the last), coloured by thickness, as PNG; returns it, for a notebook.

        It is revolved about the axis, or, in plane strain, extruded; in three dimensions it is drawn whole, and with
        `grid` the squares of that size (length) that were printed on the flat sheet.
        """
        self._reader.view(file, state or self.last, grid)
        return Picture(file)

    def wall(self, state: State | None = None) -> Any:
        """Return the wall of the part at a state (default: the last), place by place: to_csv, to_excel.

        A `Wall`, from the axis to the rim; in three dimensions a `WallInSpace`, triangle by triangle.
        """
        return self._reader.wall(state or self.last)

    def part(self, state: State | None = None, *, density: float | None = None, trim: Any = None, heights: Any = (),
             units: Units | None = None) -> Any:
        """Return the formed part in numbers (`Part`): volume, weight, area, minimum wall, uniformity; print it.

        They belong to the whole part, also where a half or a quarter is modelled; in plane strain per unit depth.

        Args:
            state: default the last.
            density: of the material in the reference configuration (under `ThermalExpansion` where it is free of
                stress), in g/cm3, for the weight in grams; say the unit of length with `units` (without, it is cm).
            trim: the radius at which the part is cut off, or ("height", h), lengths: the last place from the axis where
                the middle line goes beyond it. In three dimensions a z, beyond which the part lies.
            heights: give the wall at these heights too (`Wall.height`).
            units: a `formingx.Units`.

        Raises:
            InputError: the mesh is no sheet, or the part does not reach the trim or a height.
        """
        return self._reader.part(state or self.last, density, trim, heights, units or NONE)

    def filling(self, tool: Any = None) -> Any:
        """Return the gap that is left in each corner of a tool, state by state (`Filling`), and the pressure to fill
        it.

        Args:
            tool: its name, the `Tool` or the `Contact`; may be left out where there is one.

        Raises:
            InputError: there is no such tool, or it has no corner that the body must fill.
        """
        from .evaluate.contact_face import contact_of
        return self._reader.filling(contact_of(self, tool, "filling")[0])

    def contact(self, tool: Any = None, state: State | None = None) -> Any:
        """Contact pressure, friction and gap along the face that meets a tool (`ContactTable`): to_csv, to_excel."""
        self.section_only("contact", "use tool_forces(), or filling()")
        from .evaluate.contact_face import ContactFace, contact_of
        alone = self.alone(state or self.last)
        return ContactFace(alone, contact_of(alone, tool, "contact")[0]).of(state or self.last)

    def temperature(self, points: ArrayLike, state: State | None = None) -> np.ndarray:
        """Return the temperature in a state (default: the last) at reference points (R, Z), shape (n, 2), length:
        shape (n,)."""
        if self.problem.temperature is None:
            raise InputError("temperature: the scene has none: give Scene a temperature=...")
        state = state or self.last
        with self.segment(state).problem.state_context(state) as problem:
            return problem.temperature.at(problem.followed(as_points("Path.temperature: points", points)))

    def tool_forces(self) -> dict[str, np.ndarray]:
        """{tool: force on the whole tool at all states}, shape (states,), stress length^2 (plane strain: per depth).

        Positive when it resists its travel; of a tool that stays, along Z.
        """
        from .evaluate.contact_face import tool_forces
        return tool_forces(self)

    def work(self) -> dict[str, np.ndarray]:
        """Return the energy balance: {what: energy up to each state, shape (states,)}, stress length^3 (per depth:
        length^2).

        It belongs to the whole part, with the tools of all its images where a half or a quarter is modelled.

        Work done on the body by each load (its column; of a fixed one "pressure_on_bottom"), each driven support (its
        name, or "support") and each tool that moves; by forces that a stage leaves without balance, as they fade
        ("change"); what new meshes have added ("new_meshes"). Energy of changes of temperature ("heat"). Where it went:
        "strain_energy", above its first value; "dissipated_energy" in materials; "friction"; "jumps"; "bonds" to tools
        that the body may pull at, above their first value. "unbalanced": the error of the integrals, and of the run; of
        more than 0.5 % of the largest part a warning tells, which is one of the `findings` from then on.
        """
        self.section_only("work")
        from .evaluate.work import work
        return work(self)

    def to_stl(self, file: Any, state: State | None = None) -> None:
        """Write the part at a state (default: the last) as a solid of triangles, STL (rank 0 writes)."""
        from .files.solid import to_stl
        to_stl(self._reader.solid(state or self.last), file, self.problem.comm)

    def to_inp(self, file: Any, state: State | None = None, parts: int = 60) -> None:
        """Write the part as shells, walls their section, for CalculiX (.inp), `parts` round the axis (rank 0 writes).

        Elements S8R, S6 at the axis, on the middle surface; sets ALL, WALL, RIM; the material is for you to give.

        Raises:
            InputError: plane strain, fewer than 3 parts, or the mesh is no sheet.
        """
        from .files.shells import to_inp
        self.section_only("to_inp", "use shell_model")
        if not self.problem.scene.kinematics.axisymmetric or count("to_inp: parts", parts) < 3:
            raise InputError(f"to_inp: parts = {parts!r}: must be at least 3, of an axisymmetric body")
        to_inp(self.profile(state), parts, file, self.problem.comm)

    def to_gltf(self, file: Any, state: State | None = None, *, units: Units | None = None) -> None:
        """Write the part at a state (default: the last) as binary glTF (.glb), coloured by its wall (rank 0 writes).

        units: a `formingx.Units`; glTF is in metres, and a length that is not said is taken for m.
        """
        from .files.solid import to_gltf
        to_gltf(self._reader.solid(state or self.last), file, self.problem.comm, units or NONE)

    def section_only(self, what: str, instead: str = "") -> None:
        """Raise an InputError if the body is a sheet in three dimensions, for which `what` is not available."""
        if self.scene.kinematics.components == 3:
            raise InputError(f"{what}: is not available yet for a sheet in space" + (f": {instead}" if instead else ""))

    @cached_property
    def _reader(self) -> Reader:
        """The reader of the kinematics."""
        return (self.scene.kinematics.reader or SectionReader)(self)
