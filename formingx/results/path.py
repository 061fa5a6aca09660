"""Path of a run: its states, with methods that evaluate, draw and write them."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError, as_points, check_type, count
from ..figures import Axes
from ..findings import Finding, findings_at, worst_first
from ..solve.state import State
from ..units import NONE, Units
from .evaluate.profile import Profile, whole_part
from .evaluate.stress import StressField
from .reader import Reader, SectionReader
from .show.picture import Picture
from .states import States


class Path(States):
    """Equilibrium path of a run: its states from the unloaded body to the target.

    Attributes:
        record: the solver's record of the run (`formingx.solve.record.Record`).
        pilot: the path of the first run, from which `trace(..., adapt_mesh=True)` adapted the mesh; else None.

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
        """Return the findings of the checks before and after the run, the worst first; collective.

        A `formingx.findings.Finding` has a severity, a subject and a text. The severities are:

        "serious": do not use the results as they are.
        "warning": the scene may differ from the intended one, or a result is less accurate than usual.
        "note": the accuracy is as usual.

        >>> path.findings()
        []
        """
        return worst_first([*self.record.findings, *(findings_at("end", self) if self.states else [])])

    def profile(self, state: State | None = None) -> Profile:
        """Return the deformed outline and the thickness of a sheet; collective.

        Args:
            state: a state of the path; default the last.

        Raises:
            InputError: the mesh has no two faces of a sheet, or the sheet is in three dimensions.
        """
        state = state or self.last
        return self._view(self.segment(state)).profiles.evaluate(state)

    def stress(self, state: State | None = None) -> StressField:
        """Return the stresses and stretches of a solid body, layer by layer; collective.

        Args:
            state: a state of the path; default the last.

        Returns:
            The stress field; its `at_points` gives the stresses at reference positions.

        Raises:
            InputError: the body is a membrane, or a sheet in three dimensions.
        """
        self.section_only("stress", "look at path.wall(): stretches")
        state = state or self.last
        return self._view(self.segment(state)).stresses.evaluate(state)

    def to_csv(self, file: Any, units: Units | None = None) -> None:
        """Write a CSV file with one row per state (rank 0 writes).

        The columns are the stage (of a process), the kind of state, the number of Newton iterations, and every output
        quantity.

        Args:
            file: its name ends in .csv.
            units: units for the header, as in "tool_force [N]"; in plane strain "tool_force [N/mm]"; default none.

        Raises:
            InputError: the name has another ending.
            OSError: the file cannot be written.
        """
        from . import files
        files.write_path(self, file, units or NONE)

    def save(self, folder: Any) -> None:
        """Write every state to a checkpoint folder, from which `formingx.load` reads the path; collective.

        Args:
            folder: a new folder, or one that holds the first states of this run.

        Raises:
            InputError: the folder holds another run.
            OSError: the folder cannot be written.
        """
        from .files.checkpoint import Checkpoint
        writer = Checkpoint(folder, self)
        writer.write()
        writer.end("", self.findings())

    def to_vtk(self, file: Any, states: Any = None) -> None:
        """Write displacements, stresses and other fields of states for ParaView, one time step per state.

        The fields are displacement, stretches, stresses and their estimated error, elastic stretches of relaxing
        branches, contact pressure and thickness, as far as the body has them. For the file run.pvd, state 3 of the path
        is written to run-3.vtu; run.pvd lists the time steps. The time in ParaView is the number of the state. States
        of a remeshed run have their own meshes.

        Args:
            file: its name ends in .pvd.
            states: a state, a sequence of states, or "all"; default the last. States that `Path.state_at` solved for
                are numbered in the given order.

        Raises:
            InputError: the name has another ending, or `states` has an entry that is not a `State`.
            OSError: a file cannot be written.
        """
        from .files import fields
        fields.to_vtk(self, file, states)

    def animate(self, file: Any, frames: int = 60, seconds: float = 5.0, *, units: Units | None = None) -> Picture:
        """Draw an animation of the forming: the section of the sheet and the loading curve (rank 0 writes).

        The frames are evenly spaced over the process time, and over the change of the controls in stages without time.
        In a run without time they are evenly spaced over the motion of the controls and the sheet.
        Between states the body follows the cubic path through them. The last frame is shown for one second more.

        Args:
            file: its name ends in .gif or .mp4.
            frames: number of frames.
            seconds: duration without that last second, s.
            units: units for the labels; default none.

        Returns:
            The file, which a notebook shows.

        Raises:
            InputError: the name of the file has another ending, or ffmpeg is missing for an MP4. `frames` or `seconds`
                is not positive, the body is not a sheet in a section, or the path has one state only.
        """
        from .show import animation
        self.section_only("animate", "use report, or view3d for each state")
        animation.animate(self, file, frames, seconds, units or NONE)
        return Picture(file)

    def report(self, file: Any = "report.html", title: str = "", failure: Any = None, *, units: Units | None = None,
               density: float | None = None, trim: Any = None) -> FilePath:
        """Write an HTML file on the run: part, process, curves, inputs and warnings (rank 0 writes).

        Args:
            file: its name ends in .html.
            title: heading of the page.
            failure: the `ConvergenceError` that ended the run, or None.
            units: units of the script, for the labels; default none.
            density: density of the material for the weight of the part, g/cm3.
            trim: radius at which the part is cut off, or ("height", h), length; in three dimensions a z coordinate
                beyond which the part lies.

        Returns:
            The path of the file.

        Raises:
            InputError: plotly is not installed, the name has another ending, or a density or trim is given for a body
                that is not a sheet.
            OSError: the file cannot be written.
        """
        return self._reader.report(file, title, failure, units or NONE, density, trim)

    def plot(self, y: str, x: str, axes: Axes | None = None, **style: Any) -> Any:
        """Draw column `y` (first, vertical axis) over column `x` (horizontal axis), with a dot at each state.

        Args:
            y: name of the column on the vertical axis.
            x: name of the column on the horizontal axis.
            axes: matplotlib axes; default new ones.
            style: keyword arguments of matplotlib's `plot`.

        Returns:
            The matplotlib axes.
        """
        from .show import plots
        return plots.curve(self, y, x, axes, **style)

    def plot_convergence(self, axes: Axes | None = None) -> Any:
        r"""Draw the relative correction of the unknowns x in every Newton iteration, one line per state.

        It is the measure of convergence of Song 1993, eq. (3.5.1):

        .. math::
            |\Delta x| / |x|

        Args:
            axes: matplotlib axes; default new ones.

        Returns:
            The matplotlib axes.
        """
        from .show import plots
        return plots.convergence(self, axes)

    def view3d(self, file: Any, state: State | None = None, grid: float | None = None) -> Picture:
        """Draw the deformed sheet as a PNG file, coloured by its wall thickness over the original thickness.

        An axisymmetric sheet is revolved about the axis, a sheet in plane strain is extruded.

        Args:
            file: its name ends in .png.
            state: a state of the path; default the last.
            grid: for a sheet in three dimensions: size of the squares of a grid that is printed on the flat sheet,
                length; default no grid.

        Returns:
            The picture, which a notebook shows.

        Raises:
            InputError: the name has another ending, the body is not a sheet, or there is neither a screen nor Xvfb.
        """
        self._reader.view(file, state or self.last, grid)
        return Picture(file)

    def wall(self, state: State | None = None) -> Any:
        """Return the wall thickness of the part as a table; collective.

        Args:
            state: a state of the path; default the last.

        Returns:
            A `Wall`, from the axis to the rim. In three dimensions a `SheetWall`, triangle by triangle. Both have
            `to_csv` and `to_excel`.

        Raises:
            InputError: the body is not a sheet, or its layers do not lie above each other.
        """
        return self._reader.wall(state or self.last)

    def part(self, state: State | None = None, *, density: float | None = None, trim: Any = None, heights: Any = (),
             units: Units | None = None) -> Any:
        """Return the key numbers of the formed part: volume, weight, area, minimum wall, uniformity.

        They belong to the whole part, also if a half or a quarter is modelled. In plane strain they are per unit depth.

        Args:
            state: a state of the path; default the last.
            density: density of the material, g/cm3, for the weight in grams. It refers to the reference configuration,
                under `ThermalExpansion` to the temperature of zero thermal strain. Give `units`, too: lengths without a
                unit count as cm.
            trim: radius at which the part is cut off, or ("height", h), length. The cut lies where the middle line
                passes this radius or height for the last time on its way from the axis to the rim. In three dimensions
                a z coordinate beyond which the part lies.
            heights: heights (`Wall.height`) at which the wall is listed in `Part.walls`, length.
            units: units of the script.

        Returns:
            The numbers as a `Part`, which prints as a table.

        Raises:
            InputError: the mesh is not a sheet, or the part does not reach the trim or a height.
        """
        check_type("Path.part: units", units, Units | None, "a formingx.Units or None")
        return self._reader.part(state or self.last, density, trim, heights, units or NONE)

    def filling(self, tool: Any = None) -> Any:
        """Return the remaining gap between the body and each corner of a tool, state by state; collective.

        Args:
            tool: name of the tool, the `Tool` or the `Contact`; may be left out if there is only one tool.

        Returns:
            A `Filling`; its `pressure_at` gives the pressure at which a gap is reached.

        Raises:
            InputError: there is no such tool, it has no corner that the body must fill, or the run has several meshes.
        """
        from .evaluate.contact_face import contact_of
        return self._reader.filling(contact_of(self, tool, "filling")[0])

    def contact(self, tool: Any = None, state: State | None = None) -> Any:
        """Return the contact pressure, friction and gap along the face that touches a tool; collective.

        Args:
            tool: name of the tool, the `Tool` or the `Contact`; may be left out if there is only one tool.
            state: a state of the path; default the last.

        Returns:
            A `ContactTable`, with `to_csv` and `to_excel`.

        Raises:
            InputError: there is no such tool, or the body is a sheet in three dimensions.
        """
        self.section_only("contact", "use tool_forces(), or filling()")
        from .evaluate.contact_face import ContactFace, contact_of
        on_mesh = self.same_mesh(state or self.last)
        return ContactFace(on_mesh, contact_of(on_mesh, tool, "contact")[0]).evaluate(state or self.last)

    def temperature(self, points: ArrayLike, state: State | None = None) -> np.ndarray:
        """Return the temperature of material points in a state; collective.

        Args:
            points: reference positions (R, Z), shape (n, 2), length.
            state: a state of the path; default the last.

        Returns:
            Temperatures, shape (n,), in the unit of the scene.

        Raises:
            InputError: the scene has no temperature, or a point lies outside the body.
        """
        if self.problem.temperature is None:
            raise InputError("temperature: the scene has no temperature: give Scene temperature=...")
        state = state or self.last
        with self.segment(state).problem.state_context(state) as problem:
            return problem.temperature.at_points(problem.followed(as_points("Path.temperature: points", points)))

    def tool_forces(self) -> dict[str, np.ndarray]:
        """Return the force of the body on each tool in all states.

        The force on a moving tool is taken along its travel, positive if it resists the travel. The force on a fixed
        tool is taken along Z, positive if the body pushes the tool up. Forces belong to the whole tool, also if a half
        or a quarter is modelled.

        Returns:
            {tool: forces, shape (states,)}, stress length^2; in plane strain stress length.
        """
        from .evaluate.contact_face import tool_forces
        return tool_forces(self)

    def work(self) -> dict[str, np.ndarray]:
        """Return the energy balance of the whole part, state by state; collective.

        The balance is: work + other energies added = stored + lost + unbalanced. It belongs to the whole part, also if
        a half or a quarter is modelled. The entries are:

        Work of each load, each driven support and each moving tool, under the name of its column. The work of a fixed
        load is "pressure_on_bottom" or similar; a support without a name is "support".

        "change": work of forces left unbalanced at the beginning of a stage, which fade over the stage. "new_meshes":
        energy added by remeshing. "heat": energy added by changes of temperature.

        Stored: "strain_energy" minus its first value. Lost: "dissipated_energy" and "damage_energy" of materials,
        "friction", "jumps" (in snap-through), and "bonds" to adhesive tools. Entries that a run cannot have are left
        out: without friction `path.work().get("friction", 0.0)` is 0.

        "unbalanced": the rest, an error of the integrals and of the run. Above 0.5 % of the largest entry a warning is
        logged and added to the `findings`.

        Returns:
            {entry: energy up to each state, shape (states,)}, stress length^3; in plane strain stress length^2.

        Raises:
            InputError: the body is a sheet in three dimensions, or its material is of K-BKZ type.
        """
        self.section_only("work")
        from .evaluate.work import work
        return work(self)

    def to_stl(self, file: Any, state: State | None = None) -> None:
        """Write the part in a state as the triangles of its surface, in binary STL (rank 0 writes).

        Args:
            file: its name ends in .stl.
            state: a state of the path; default the last.

        Raises:
            InputError: the name has another ending, or the body is not a sheet.
            OSError: the file cannot be written.
        """
        from .files.solid import to_stl
        to_stl(self._reader.solid(state or self.last), file, self.problem.comm)

    def to_inp(self, file: Any, state: State | None = None, parts: int = 60) -> None:
        """Write the part as shell elements with the wall as thickness, for CalculiX or Abaqus (rank 0 writes).

        The elements are S8R, at the axis S6, on the middle surface. The element set is WALL, the node sets are ALL and
        RIM, the outer end of the part; both ends, if only a half between them is modelled. The file contains no
        material.

        Args:
            file: its name ends in .inp.
            state: a state of the path; default the last.
            parts: number of elements round the axis.

        Raises:
            InputError: the name has another ending, the body is not an axisymmetric sheet, or `parts` is below 3.
            OSError: the file cannot be written.
        """
        from .files.shells import to_inp
        self.section_only("to_inp", "use shell_model")
        if not self.problem.scene.kinematics.axisymmetric or count("to_inp: parts", parts) < 3:
            raise InputError(f"to_inp: parts = {parts!r}: must be at least 3, of an axisymmetric body")
        to_inp(whole_part(self.profile(state), self.scene.symmetry), parts, file, self.problem.comm)

    def to_gltf(self, file: Any, state: State | None = None, *, units: Units | None = None) -> None:
        """Write the part in a state as binary glTF, coloured by its wall (rank 0 writes).

        Args:
            file: its name ends in .glb.
            state: a state of the path; default the last.
            units: units of the script; glTF is in metres, and lengths without a unit count as metres.

        Raises:
            InputError: the name has another ending, or the body is not a sheet.
            OSError: the file cannot be written.
        """
        from .files.solid import to_gltf
        to_gltf(self._reader.solid(state or self.last), file, self.problem.comm, units or NONE)

    def section_only(self, what: str, instead: str = "") -> None:
        """Raise an error for a method that does not exist in three dimensions.

        Args:
            what: name of the method.
            instead: advice for the message.

        Raises:
            InputError: the body is a sheet in three dimensions.
        """
        if self.scene.kinematics.components == 3:
            raise InputError(f"{what}: is not available yet for a sheet in three dimensions"
                             + (f": {instead}" if instead else ""))

    @cached_property
    def _reader(self) -> Reader:
        """Object that evaluates walls, parts, pictures and reports for the kinematics of the scene."""
        return (self.scene.kinematics.reader or SectionReader)(self)
