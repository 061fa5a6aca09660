"""A disc with FElupe: what its scripts share. FElupe's axis is x.

Biquadratic quadrilaterals; for loading and plug of nearly incompressible material that keeps pressure and volume to
itself.
"""

import felupe as fem


def quadrilaterals(elements, radius, thickness):
    """The mesh: elements along the radius and through the thickness."""
    n, m = elements
    mesh = fem.Rectangle(b=(thickness, radius), n=(m + 1, n + 1)).add_midpoints_edges().add_midpoints_faces()
    return fem.Mesh(mesh.points, mesh.cells, "quad9")


def disc(elements, radius, thickness, c10):
    """(mesh, field of displacements, solid body)."""
    mesh = quadrilaterals(elements, radius, thickness)
    field = fem.FieldContainer([fem.FieldAxisymmetric(fem.RegionBiQuadraticQuad(mesh), dim=2)])
    return mesh, field, fem.SolidBodyNearlyIncompressible(fem.NeoHooke(mu=2 * c10), field, bulk=5000 * 2 * c10)
