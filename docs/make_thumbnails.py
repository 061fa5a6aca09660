"""Cut one panel out of each picture of several panels, readable in the columns of the gallery.

    ./fx python3 docs/make_thumbnails.py

The pictures stand in `demos/pictures`, as the demos draw them; the panels go to `docs/thumbnails`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

DOCS = Path(__file__).parent
PICTURES, THUMBNAILS = DOCS.parent / "demos" / "pictures", DOCS / "thumbnails"
WIDTH, COLOURS, MARGIN = 480, 128, 6                           # pixels, colours, pixels
PANELS = {
    "balloon": (0, 0, 1 / 3, 1), "bottle_3_to_1": (0, 0, 0.31, 1), "chilling": (0.5, 0, 1, 0.5),
    "clamp_ring": (0.64, 0, 1, 1), "closing_halves": (0.5, 0, 1, 1),
    "cold_plug": (0.635, 0, 1, 1), "compression_grids": (0, 0.725, 1, 1),
    "contact_convergence": (0.667, 0, 1, 1), "cup_adapted": (0, 0, 0.5, 1), "even_bottle": (0, 0, 0.5, 1),
    "even_disc": (0, 0, 0.5, 1), "even_pot": (0, 0, 0.5, 1), "even_trough": (0, 0, 0.5, 1),
    "fit_treloar": (0, 0.04, 0.325, 0.79), "heated_disc": (1 / 3, 0, 0.655, 1), "heating": (2 / 3, 0.485, 1, 1),
    "kbkz": (2 / 3, 0, 1, 1), "material_constants_plates": (0, 0, 0.58, 1), "measured_biaxial": (0.5, 0, 1, 1),
    "measured_ellipse": (0, 0, 0.361, 1), "measured_ldpe": (1 / 3, 0, 2 / 3, 1), "measured_treloar": (0, 0, 0.5, 1),
    "oven": (0, 0, 0.49, 1), "plug_adapted": (0, 0, 0.5, 1), "plug_friction": (0, 0, 0.5, 1),
    "plug_stress_held": (0, 0.04, 0.33, 0.515), "pot_study": (0, 0, 1 / 3, 1), "relaxation": (0, 0, 0.32, 1),
    "relaxing_pot": (0.5, 0, 1, 1), "setting_pot": (0, 0, 0.49, 1),
    "stretch_blow": (0.7, 0, 1, 1),
    "viscoelastic_disc": (0, 0, 0.325, 1), "viscoelastic_tube": (0, 0, 0.49, 1),
}
"""Panel of each picture: left, top, right, bottom, in parts of its width and height."""


def panel(name: str) -> Image.Image:
    """Return the panel of a picture, without its white border, at most `WIDTH` pixels wide."""
    with Image.open(PICTURES / f"{name}.png") as picture:
        width, height = picture.size
        left, top, right, bottom = PANELS[name]
        box = tuple(map(round, (left * width, top * height, right * width, bottom * height)))
        part = picture.convert("RGB").crop(box)
    rows, columns = np.nonzero(np.asarray(part).min(axis=-1) < 250)
    part = part.crop((max(columns.min() - MARGIN, 0), max(rows.min() - MARGIN, 0),
                      min(columns.max() + MARGIN, part.width), min(rows.max() + MARGIN, part.height)))
    part.thumbnail((WIDTH, 3 * WIDTH))
    return part


if __name__ == "__main__":
    THUMBNAILS.mkdir(exist_ok=True)
    for each in PANELS:
        panel(each).quantize(COLOURS).save(THUMBNAILS / f"{each}.png", optimize=True)
