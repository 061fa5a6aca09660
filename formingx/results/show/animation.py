"""The forming as a moving picture: section and loading curve, frame by frame."""

from __future__ import annotations

from typing import Any

import numpy as np

from ... import figures
from ...discrete.tooling import Tooling
from ...errors import InputError, count, place, positive
from .. import files
from . import plots


def animate(path: Any, file: Any, frames: int, seconds: float) -> None:
    """See `Path.animate`."""
    file = place("animate: file", file)
    if file.suffix.lower() != ".gif":
        raise InputError(f"animate: file {str(file)!r}: its name must end in .gif")
    frames, seconds = count("animate: frames", frames), positive("animate: seconds", seconds)
    if len(path) < 2:
        raise InputError(f"animate: the path has {len(path)} states: nothing moves")
    x, y = plots.main_columns(path.columns)
    shapes, tools, now, tooling = [], [], [], Tooling.of_problem(path.problem)
    for a, b, fraction in _spread(path, frames):
        at = path.between(a, b, fraction)
        shapes.append(path.profile(at))
        now.append([a.measures[c] + fraction * (b.measures[c] - a.measures[c]) for c in (x, y)])
        tools.append(tooling.placed(tooling.travels(at.setting, at.control)))
    curve = path.curve(x, y)
    axisymmetric = path.problem.scene.kinematics.dimension_of_volume == 3

    def draw(stream):
        _draw(shapes, tools, np.array(now), curve, (x, y), axisymmetric, seconds, stream)
    files.on_root(path.problem.comm, lambda: files.replace(file, draw, "wb"))


def _spread(path: Any, frames: int) -> list[tuple[Any, Any, float]]:
    """(state, next state, fraction between them) of frames evenly spread over the arc length."""
    lengths = [path.distance(a, b) for a, b in zip(path.states, path.states[1:])]
    at = np.concatenate([[0.0], np.cumsum(lengths)])
    found = []
    for s in np.linspace(0, at[-1], frames) if frames > 1 else at[-1:]:
        k = int(np.clip(np.searchsorted(at, s, side="right") - 1, 0, len(lengths) - 1))
        found.append((path.states[k], path.states[k + 1], float((s - at[k]) / (lengths[k] or 1.0))))
    return found


def _draw(shapes: list, tools: list, now: np.ndarray, curve: list, names: tuple, axisymmetric: bool, seconds: float,
          stream: Any) -> None:
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from PIL import Image
    r = np.concatenate([s.bottom[:, 0] for s in shapes])
    sides = (1, -1) if axisymmetric or abs(r.min()) < 1e-9 * r.max() else (1,)
    low, high = plots.span(shapes, mirrored=len(sides) == 2)
    ratios = [s.wall_ratio for s in shapes]
    colours = Normalize(min(r.min() for r in ratios), max(r.max() for r in ratios))
    figure, (left, right) = plots.figure(2, width=5.0, height=4.2, ratios=(1.5, 1))
    bar = figure.colorbar(ScalarMappable(colours, "viridis_r"), ax=left, shrink=0.8, label="thickness / original")
    bar.outline.set_visible(False)
    right.plot(*curve, color="0.6")
    right.set(xlabel=names[0].replace("_", " "), ylabel=names[1].replace("_", " "))
    dot, = right.plot([], [], "o", color="tab:red")
    text = right.set_title("", fontsize=10)
    pictures: list[Any] = []
    for shape, ratio, tool, at in zip(shapes, ratios, tools, now):
        left.clear()
        left.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="r", ylabel="z", aspect="equal")
        left.spines[["top", "right"]].set_visible(False)
        figures.tools(left, tool, low, high, mirror=len(sides) == 2)
        for side in sides:
            plots.section(left, shape, (side, 1), colormaps["viridis_r"](colours(ratio)))
        dot.set_data(at[:1], at[1:])
        text.set_text(f"{names[1].replace('_', ' ')} {at[1]:.4g}")
        figure.canvas.draw()
        if not pictures:
            figure.set_layout_engine("none")                # or the axes would shift from frame to frame
        pictures.append(Image.fromarray(np.asarray(figure.canvas.buffer_rgba())).convert("RGB")
                        .quantize(256, dither=Image.Dither.NONE))
    each = max(int(1000 * seconds / len(pictures)), 20)
    pictures[0].save(stream, format="GIF", save_all=True, append_images=pictures[1:], loop=0, optimize=False,
                     duration=[each] * (len(pictures) - 1) + [each + 1000])
