"""Check of the number of ranks against the size of the mesh."""

from collections.abc import Iterator

from ..findings import Finding, register
from ..scene.scene import Scene
from .sizes import SizedBody

WITHOUT_GAIN = 1_150_000
"""Number of unknowns up to which an iteration on two ranks takes as long as on one (benchmarks/ranks.py)."""


def unknowns(scene: Scene) -> int:
    """Return about the number of unknowns of a scene, without multipliers, and without compiling; collective."""
    topology = scene.mesh.domain.topology
    topology.create_entities(1)
    vertices, edges, cells = (topology.index_map(dim).size_global if dim <= topology.dim else 0 for dim in (0, 1, 2))
    pressure, components = scene.model.pressure if scene.model.solid else None, scene.kinematics.components
    if pressure is None:
        return int(components * (vertices + edges))
    pressures = vertices if pressure.continuous else cells * (1 + 2 * pressure.degree)
    return int(components * (vertices + edges + cells * pressure.bubble) + pressures)


@register("start")
def _ranks(body: SizedBody) -> Iterator[Finding]:
    """Report a run on several ranks with so few unknowns that one rank is as fast."""
    size, number = body.scene.mesh.comm.size, unknowns(body.scene)
    if size > 1 and number < WITHOUT_GAIN:
        yield Finding("note", "ranks", f"{size} ranks for {number} unknowns: up to {WITHOUT_GAIN} unknowns an iteration"
                      " on two ranks takes as long as on one (benchmarks/ranks.py); run several scenes side by side"
                      " instead, by fx.study(workers=...)")
