"""Write the coarse grids of the thesis' examples (Song 1993), for comparison with other solvers.

    ./fx python3 meshes/make.py

Six-node triangles with named layers and boundaries, coordinates (R, Z) in the thesis' units: as gmsh files (MSH 2.2,
text) and in the text format of formingx.mesh.text, corners first.
"""

from pathlib import Path

import formingx as fx

GRIDS = {
    "treloar_20": {"radius": 1.25, "thickness": 0.082, "elements": (10, 1)},                       # cm
    "thick_plate_20": {"radius": 7.5, "thickness": 0.5, "elements": (10, 1)},                      # in
    "two_layer_40": {"radius": 19.1, "thickness": {"lower": 0.635, "upper": 0.635}, "elements": (10, 1)},   # cm
    "cylinder_6": {"radius": 18.625, "inner_radius": 7.0, "thickness": 4.0, "elements": (3, 1)},   # in
    "cylinder_12": {"radius": 18.625, "inner_radius": 7.0, "thickness": 2.0, "elements": (6, 1)},  # in
}

if __name__ == "__main__":
    for name, size in GRIDS.items():
        for suffix in ("msh", "txt"):
            fx.mesh.write(fx.mesh.disc(**size), Path(__file__).parent / f"{name}.{suffix}")
        print(f"{name}.msh")
