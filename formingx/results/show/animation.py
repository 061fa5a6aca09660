"""Animation of the forming: the section and the loading curve, in frames evenly spaced over the process."""

import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ... import figures
from ...contact.tooling import Tooling
from ...errors import InputError, count, positive
from ...units import NONE, Units
from .. import files
from . import plots
from .report_data import progress


def between(record: Any, a: Any, b: Any, fraction: float) -> Any:
    """Return the state at a fraction on the cubic to the next, not in equilibrium; `b` if it begins a stage."""
    if a.setting != b.setting:
        return b
    x, control = record.segment(b).curve.interpolate(a, b, fraction)
    return replace(b, x=x, control=control)


def animate(path: Any, file: Any, frames: int, seconds: float, units: Units = NONE) -> None:
    """Draw the animation of a path to a .gif or .mp4 file (`Path.animate`).

    `seconds` is the duration, with one more for the last frame. Another ending, missing ffmpeg, no sheet or a single
    state is an InputError, a failed file an OSError.
    """
    file = files.named("animate", file, ".gif", ".mp4")
    if file.suffix.lower() == ".mp4" and _ffmpeg() is None:
        raise InputError(f"animate: file {str(file)!r}: an MP4 needs the program ffmpeg, which is not there; a .gif"
                         f" needs nothing")
    frames, seconds = count("animate: frames", frames), positive("animate: seconds", seconds)
    if len(path) < 2:
        raise InputError(f"animate: the path has {len(path)} states: nothing moves")
    reader = path.scene.kinematics.reader if path.scene.kinematics.components == 3 else None
    make = reader(path).pictures(frames) if reader else _section_pictures(path, frames, units)

    def draw():
        save = _save_gif if file.suffix.lower() == ".gif" else _save_mp4
        pictures = make()
        files.replace(file, lambda stream: save(pictures, seconds, stream), "wb")
    files.on_root(path.problem.comm, draw)


def _section_pictures(path: Any, frames: int, units: Units) -> Callable[[], list[Any]]:
    """Return a function that draws the frames of a section on rank 0; collective."""
    shapes, tools, now, tooling, shown = [], [], [], Tooling.of_problem(path.problem), columns_of_stages(path)
    for a, b, fraction in spread(path, frames):
        interpolated = between(path.record, a, b, fraction)
        shapes.append(path.profile(interpolated))
        names = shown[b.stage]
        now.append((names, [a.measures[c] + fraction * (b.measures[c] - a.measures[c]) for c in names]))
        tools.append(tooling.placed(tooling.travels(interpolated.setting, interpolated.control)))
    curves = {names: path.curve(*names) for names in shown.values()}
    both_sides = has_image_at_axis(path.problem.scene)
    return lambda: _draw(shapes, tools, now, curves, both_sides, units)


def _ffmpeg() -> str | None:
    """Return the command ffmpeg of the system, or the program in PyPI's package `imageio-ffmpeg`; None without both."""
    if (found := shutil.which("ffmpeg")) is not None:
        return found
    try:
        import imageio_ffmpeg
    except ImportError:
        return None
    try:
        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except RuntimeError:                                     # a package without the program
        return None


def has_image_at_axis(scene: Any) -> bool:
    """Return True if the part has a mirror image at r = 0: a ring, or a half with its mirror plane there."""
    ring = scene.kinematics.dimension_of_volume == 3
    near = scene.symmetry.near
    return ring or any(plane.axis == 0 and abs(plane.position) <= near for plane in scene.symmetry.planes)


def spread(path: Any, frames: int, sheet: bool = True) -> list[tuple[Any, Any, float]]:
    """Return (state, next state, position 0 to 1) of frames evenly spaced over the progress of the process.

    sheet: True for a sheet in a section, whose motion counts in a run without time.
    """
    profiles = [path.profile(state) if sheet else None for state in path.states]
    done = progress({c: path[c] for c in path.columns}, profiles)
    found = []
    for s in np.linspace(0, done[-1], frames) if frames > 1 else done[-1:]:
        k = int(np.clip(np.searchsorted(done, s, side="right") - 1, 0, len(done) - 2))
        gap = done[k + 1] - done[k]                         # 0 at the end only
        found.append((path.states[k], path.states[k + 1], float((s - done[k]) / gap) if gap else 1.0))
    return found


def columns_of_stages(path: Any) -> dict[str, tuple[str, str]]:
    """Return {stage: (column x, column y)} of the loading curves.

    Constant pressures and travels are left out. If all are constant, a force over the process time is drawn, or the
    pole height.
    """
    found = {}
    for stage in dict.fromkeys(state.stage for state in path.states):
        values = {c: [s.measures[c] for s in path.states if s.stage == stage] for c in path.columns}
        moving = [c for c, v in values.items() if np.ptp(v) > 0 or not c.endswith(("travel", "pressure"))]
        driven = any(c.endswith(("travel", "pressure")) for c in moving)
        timed = np.ptp(values.get("process_time", 0.0)) > 0
        over_time = next((c for c, v in values.items() if c.endswith("force") and np.ptp(v) > 0), None)
        if not driven and timed and over_time:
            found[stage] = "process_time", over_time
        else:
            found[stage] = plots.main_columns(moving if driven or timed else path.columns)
    return found


def _draw(shapes: list, tools: list, now: list, curves: dict, both_sides: bool, units: Units) -> list[Any]:
    """Return the frames of the animation as images; `both_sides` draws the mirror image at r = 0, too.

    `tools` has (tool, displacement (2,)) of active tools and `now` ((x, y) columns, their values) in each frame;
    `curves` maps (x, y) to values (m,) each.
    """
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from PIL import Image
    sides = (1, -1) if both_sides else (1,)
    low, high = plots.span(shapes, mirrored=both_sides)
    ratios = [s.wall_ratio for s in shapes]
    colours = Normalize(min(r.min() for r in ratios), max(r.max() for r in ratios))
    wide = float(np.clip(3.5 * (high - low)[0] / (high - low)[1] + 1.4, 2.8, 6.0))    # a bottle fills its panel, too
    figure, (sheet, loading) = figures.figure(2, width=wide / 2 + 2, height=4.2, ratios=(wide, 4))
    bar = figure.colorbar(ScalarMappable(colours, "viridis_r"), ax=sheet, shrink=0.8, label="thickness / original")
    bar.outline.set_visible(False)

    def draw(shape, ratio, tool, names, point):
        sheet.clear()
        sheet.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel=units.label("r"), ylabel=units.label("z"),
                  aspect="equal")
        sheet.spines[["top", "right"]].set_visible(False)
        figures.tools(sheet, tool, low, high, mirror=both_sides)
        for side in sides:
            plots.section(sheet, shape, (side, 1), colormaps["viridis_r"](colours(ratio)))
        _curve(loading, names, curves[names], point, units)
        figure.canvas.draw()
        return Image.fromarray(np.asarray(figure.canvas.buffer_rgba())).convert("RGB")

    def width(names):
        """Return the width of the plot of a loading curve without its labels, as a fraction of the figure's width."""
        draw(shapes[0], ratios[0], tools[0], names, (curves[names][0][0], curves[names][1][0]))
        return loading.get_position().width
    width(min(curves, key=width))
    figure.set_layout_engine("none")                        # or the axes would shift from frame to frame
    return [draw(shape, ratio, tool, *curve) for shape, ratio, tool, curve in zip(shapes, ratios, tools, now)]


def _curve(axes: Any, names: tuple[str, str], curve: list, point: list[float], units: Units) -> None:
    """Draw the loading curve, values (m,) of columns x and y, and a dot at the state of the frame."""
    x, y = map(units.label, names)
    axes.clear()
    axes.grid(True, color="0.9", linewidth=0.7)
    axes.plot(*curve, color="0.6")
    axes.plot(*point, "o", color="tab:red")
    axes.set(xlabel=x, ylabel=y)
    value = point[1] if abs(point[1]) > 1e-9 * np.abs(curve[1]).max() else 0.0
    axes.set_title(f"{names[1].replace('_', ' ')} {value:.4g} {units.unit_of(names[1])}".rstrip(), fontsize=10)


def _save_gif(pictures: list[Any], seconds: float, stream: Any) -> None:
    """Write images as an animated GIF of `seconds`, with one second more for the last one."""
    from PIL import Image
    pictures = [picture.quantize(256, dither=Image.Dither.NONE) for picture in pictures]
    each = max(int(1000 * seconds / len(pictures)), 20)
    pictures[0].save(stream, format="GIF", save_all=True, append_images=pictures[1:], loop=0, optimize=False,
                     duration=[each] * (len(pictures) - 1) + [each + 1000])


def _save_mp4(pictures: list[Any], seconds: float, stream: Any) -> None:
    """Write images as MP4 (H.264), the last for a second more, and close the stream; a failure is an OSError."""
    width, height = (2 * (n // 2) for n in pictures[0].size)              # H.264 wants even numbers
    rate = len(pictures) / seconds
    stream.close()                                           # ffmpeg writes the file by its name
    command = [_ffmpeg() or "ffmpeg", "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24",
               "-s", f"{width}x{height}", "-r", f"{rate:.6f}", "-i", "-", "-pix_fmt", "yuv420p",
               "-movflags", "+faststart", "-f", "mp4", stream.name]
    frames = [picture.crop((0, 0, width, height)).tobytes() for picture in pictures]
    frames += frames[-1:] * max(int(rate), 1)
    done = subprocess.run(command, input=b"".join(frames), capture_output=True, check=False)
    if done.returncode:
        raise OSError(None, f"ffmpeg: {done.stderr.decode().strip()[-200:]}")
