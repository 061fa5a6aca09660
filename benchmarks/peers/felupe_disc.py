"""A disc with FElupe, for its scripts. FElupe's axis is x.

Biquadratic quadrilaterals; for loading and plug of nearly incompressible material whose pressure and volume are local.
"""

import felupe as fem


def quadrilaterals(elements, radius, thickness):
    """Return the mesh: elements along the radius and through the thickness."""
    n, m = elements
    mesh = fem.Rectangle(b=(thickness, radius), n=(m + 1, n + 1)).add_midpoints_edges().add_midpoints_faces()
    return fem.Mesh(mesh.points, mesh.cells, "quad9")


def disc(elements, radius, thickness, c10):
    """Return the mesh, the field of displacements and the solid body."""
    mesh = quadrilaterals(elements, radius, thickness)
    field = fem.FieldContainer([fem.FieldAxisymmetric(fem.RegionBiQuadraticQuad(mesh), dim=2)])
    return mesh, field, fem.SolidBodyNearlyIncompressible(fem.NeoHooke(mu=2 * c10), field, bulk=5000 * 2 * c10)
