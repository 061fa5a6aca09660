"""Comparisons of the page validation.md: our number, reference with its source, unit."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from formingx.exact import stability
from formingx.exact.inflation import membrane_inflation, membrane_limit_point
from formingx.exact.time import balloon

LAWS = ("neo-Hookean", "Mooney-Rivlin", "Yeoh", "Gent", "Arruda-Boyce", "Ogden")
TRELOAR = {"radius": 1.25, "thickness": 0.082, "c10": 2.0}                # cm, kg/cm2


class Row(NamedTuple):
    """A number compared with another.

    Attributes:
        what: the quantity, in words.
        ours: key NAME/KEY/... of our number in results/NAME/summary.json, or `A OVER B` of two.
        reference: a number; a key such as `ours`; a function that computes it; None if there is none.
        source: source of the reference.
        unit: unit of both.
        style: format of both numbers.
        absolute: True if the deviation is the difference, for references of 0.
        note: a remark beside the deviation, or in its place.
    """

    what: str
    ours: str
    reference: float | str | Callable[[], float] | None
    source: str
    unit: str = ""
    style: str = ".5g"
    absolute: bool = False
    note: str = ""


def _cylinder(cm: str) -> Row:
    key = "pressure_MPa_at_inner_displacement_cm"
    return Row(f"thick cylinder, pressure at an inner displacement of {cm} cm", f"thick_cylinder/cylinder/{key}/{cm}",
               f"thick_cylinder/cylinder/exact_{key}/{cm}", "exact", "MPa", ".6f")


def _disc(case: str, words: str) -> Row:
    return Row(f"disc in three dimensions at pole stretch 3, pressure over that of a membrane of revolution{words}",
               f"disc_in_space/{case}/pressure_over_axisymmetric/3", 1.0, "membrane of revolution", style=".5f")


def _blown_balloon() -> float:
    """Return p R0/H0 of the balloon of demos/balloon.py at stretch 2, blown by 2.6 of its volume a second, MPa."""
    body = balloon(c10=0.05, branches=[(0.3, 0.5), (0.4, 5.0)])
    return float(body.deform(lambda t: (math.log1p(2.6 * t) / 3, 2.6 / 3 / (1 + 2.6 * t)), [7 / 2.6])[0])


def _program(problem: str, key: str, what: str, unit: str, source: str) -> Row:
    path = f"other_programs/{problem}/{key}"
    return Row(what, f"{path}/ours", f"{path}/theirs", source, unit, ".6g")


EXACT = [
    Row("Treloar's sheet, limit pressure", "treloar/simply_supported/limit_pressure_kg_per_cm2",
        lambda: membrane_limit_point(**TRELOAR)[1].pressure, "membrane theory, without bending", "kg/cm²", ".6f"),
    Row("Treloar's sheet, pressure at pole stretch 8.5",
        "treloar/simply_supported/pressure_kg_per_cm2_at_stretch/8.5",
        lambda: membrane_inflation(8.5, **TRELOAR).pressure, "membrane theory", "kg/cm²", ".5f"),
    *map(_cylinder, ("10", "30", "50")),
    Row("thick sphere, limit pressure", "thick_cylinder/sphere/limit_pressure_MPa",
        "thick_cylinder/sphere/exact_limit_pressure_MPa", "exact", "MPa", ".7f"),
    Row("thick sphere, inner displacement there", "thick_cylinder/sphere/inner_displacement_cm_at_limit",
        "thick_cylinder/sphere/exact_inner_displacement_cm_at_limit", "exact", "cm", ".5f"),
    Row("thick plate, simply supported, initial slope over linear theory",
        "thick_plate/simply_supported/slope_over_linear_theory", 1.0, "linear plate theory, without shear"),
    Row("plate A, limit pressure", "material_constants/A/limit_pressure_psi",
        "material_constants/A/membrane_limit_pressure_psi", "membrane theory", "psi"),
    Row("block without friction, force", "compression_homogeneous/force_N", "compression_homogeneous/exact_force_N",
        "exact (7.6)", "N", ".2f"),
    Row("block without friction, outer radius", "compression_homogeneous/outer_radius_cm",
        "compression_homogeneous/exact_outer_radius_cm", "exact", "cm", ".5f"),
    Row("block without friction, stress S^zz", "compression_homogeneous/stress_Szz_MPa",
        "compression_homogeneous/exact_stress_Szz_MPa", "exact (7.7)", "MPa", ".4f"),
    Row("long part, wall at the middle of its floor", "rectangular_part/stick/pole_thickness_ratio_at_psi/160",
        "rectangular_part/membrane/floor_thickness_ratio", "membrane without thickness", style=".3f"),
    Row("long part, wall at its fillet", "rectangular_part/stick/min_thickness_ratio_at_psi/160",
        "rectangular_part/membrane/least_thickness_ratio", "membrane without thickness", style=".3f"),
    _disc("size_0.05", ", triangles of 1/20 of the radius"), _disc("size_0.025", ", 1/40"),
    _disc("extrapolated", ", two sizes extrapolated"),
    Row("tube of length 4 R whose ends are held, limit pressure p R/(mu H)",
        "square_bottle/inflation/limit_pressure_R_over_mu_H", 0.91071, "axisymmetric membrane theory", style=".4f"),
    Row("the same tube, volume at the limit point over the first one",
        "square_bottle/inflation/limit_volume_over_first", 2.7368, "axisymmetric membrane theory", style=".4f"),
    Row("square bottle, wall in the middle of a face", "square_bottle/square_bottle/middle_of_face_mm/mid_height",
        "square_bottle/square_bottle/plane_strain/middle_of_face_mm", "plane strain, same area of wall", "mm", ".3f"),
    Row("square bottle, wall at its edge", "square_bottle/square_bottle/edge_mm/mid_height",
        "square_bottle/square_bottle/plane_strain/edge_mm", "plane strain, same area of wall", "mm", ".3f"),
    Row("round bottle of a thin tube in three dimensions, minimum wall over that of a solid",
        "square_bottle/round/least_wall_over_solid", 1.0, "solid of axisymmetric elements", style=".4f"),
    Row("round bottle of a thick preform with a rod, minimum wall over that of a solid",
        "stretch_blow/round/least_wall_over_solid", 1.0, "solid of axisymmetric elements", style=".3f"),
    Row("trough in three dimensions, error of its wall", "tray/trough/size_0.05/wall_error", 0.0,
        "power law of a membrane", style=".1e", absolute=True),
    Row("relaxing balloon at stretch 2, p R0/H0", "balloon/flow_2.6/p_R0_over_H0_at_stretch/2", _blown_balloon,
        "exact, thin wall", "MPa", ".5f"),
    *(Row(f"{what}, largest error over the span", f"{path}", 0.0, reference, style=".1e", absolute=True)
      for what, path, reference in (
          ("sheet in warm air, temperature", "heating/largest_error_over_span/convection", "series"),
          ("sheet between heaters, temperature", "heating/largest_error_over_span/radiation_400_400", "line method"),
          ("sheet laid on cold steel, temperature", "chilling/largest_error_over_span/steel", "Laplace transform"))),
    Row("K-BKZ blocks at constant rates, largest error", "kbkz/largest_error_of_blocks/psm", 0.0,
        "homogeneous integration", style=".1e", absolute=True),
    Row("block drawn hot, set and let go: stretch", "set_block/uniaxial/G_200/stretch",
        "set_block/uniaxial/G_200/exact", "exact balance", style=".6f"),
    Row("cylinder between plates, height pi radii: stretch at which it bends", "stability/cylinder/nu_1/n_1",
        lambda: stability.cylinder(1, 1), "exact bifurcation", style=".6f"),
    Row("tube under outer pressure, radii 0.8 : 1, two waves: pressure over modulus",
        "stability/tube/0.8/n_2/pressure_over_mu", lambda: stability.tube(0.8, 2)[0], "exact bifurcation", style=".6f"),
    Row("tube blown up at its length pi outer radii, radii 0.5 : 1: inner radius at which it bulges",
        "stability/inflated_tube/0.5/kB_1/n_0/inner_radius_ratio", lambda: stability.inflated_tube(0.5, 1.0, 0),
        "exact bifurcation", style=".5f"),
    Row("block in plane strain, length pi/2 thicknesses: stretch at which it bends", "stability/block/nu_1/flexure",
        lambda: stability.block(1, "flexure"), "exact bifurcation", style=".6f"),
    Row("clamped plate, without waves round it: load", "stability/plate/clamped/n_0",
        lambda: stability.clamped_plate(0), "thin plate, without shear", style=".4f"),
    Row("thin sheet on a plug, edge of 0.18 plug radii, force over the membrane's",
        "throne_plug/force_over_membrane_at_fillet_over_rp/0.18", 1.0, "membrane, sharp edge", style=".3f"),
    Row("the same, 0.06 plug radii", "throne_plug/force_over_membrane_at_fillet_over_rp/0.06", 1.0,
        "membrane, sharp edge", style=".3f"),
    Row("the same, 0.02 plug radii", "throne_plug/force_over_membrane_at_fillet_over_rp/0.02", 1.0,
        "membrane, sharp edge", style=".3f"),
]

THESIS = [
    Row("Treloar's sheet, limit pressure", "treloar/simply_supported/limit_pressure_kg_per_cm2", 0.493, "section 4.3",
        "kg/cm²"),
    Row("Treloar's sheet, pressure at pole stretch 8.5",
        "treloar/simply_supported/pressure_kg_per_cm2_at_stretch/8.5", 0.349, "section 4.3", "kg/cm²", ".4g",
        note="20 triangles; coarse meshes are stiff there"),
    Row("thick cylinder, pressure at 50 cm", "thick_cylinder/cylinder/pressure_MPa_at_inner_displacement_cm/50", 1.26,
        "section 3.6", "MPa", ".4g", note="no state of this wall carries so much"),
    Row("plate B at 26 psi, height", "material_constants/B/pole_height_in/26", 6.0, "section 4.4: about", "in", ".4g"),
    Row("plate A, its maximum", "material_constants/A/limit_pressure_psi", 26.0, "section 4.4: carries it at 9 in",
        "psi", ".5g", note="no such state"),
    Row("plate A, height at its maximum", "material_constants/A/limit_pole_height_in", None,
        "section 4.4: 9 in at 26 psi", "in", ".3g", note="membrane theory agrees with the maximum"),
    Row("block without friction, volume error", "compression_homogeneous/volume_error", None, "table 7.1: 3.6e-3",
        style=".0e"),
    Row("stuck block over Lindley's force at 0.1 cm", "compression_stick/stick_over_lindley/0.1", 1.0,
        "figure 7.3: about", style=".3f"),
    Row("the same at 0.4 cm", "compression_stick/stick_over_lindley/0.4", 1.0, "figure 7.3: about", style=".3f"),
    Row("rolling block, compression ratio reached", "compression_roll_over/reached_ratio", 5.23,
        "figures 7.5, 7.6", style=".3g"),
    Row("plug without slip, travel reached", "williams_plug/held/reached_travel_cm", 20.0, "figures 6.1, 6.2", "cm",
        ".3g"),
    Row("force at 20 cm, hinged over clamped rim",
        "williams_plug/held_hinged/force_N_at_travel_cm/20 OVER williams_plug/held/force_N_at_travel_cm/20", None,
        "figure 6.10: small differences", style=".4f"),
    Row("frictionless plug at pole stretch 1.25, hoop stretch outside it, mean deviation from 1",
        "williams_plug/frictionless_at_pole_stretch_of_thesis/mean_hoop_deviation_outside_plug", 0.062, "figure 6.4",
        style=".3f"),
    Row("the same, wall under the plug over h0, least", "williams_plug/frictionless_at_pole_stretch_of_thesis/"
        "flat_top_thickness_ratio/0", None, "figure 6.3: 0.3 to 0.7", style=".2f",
        note="undecided: the travel is not printed"),
    Row("the same, wall under the plug over h0, largest", "williams_plug/frictionless_at_pole_stretch_of_thesis/"
        "flat_top_thickness_ratio/1", None, "figure 6.3: 0.3 to 0.7", style=".2f",
        note="undecided: the travel is not printed"),
    Row("no slip, R of the largest stress on the top face", "plug_stress/held/standard/6/largest_sigma_1/R_cm", 1.905,
        "figure 6.12", "cm", ".3g"),
    Row("no slip, R of the largest strain", "plug_stress/held/standard/6/largest_eps_1/R_cm", 2.1,
        "figure 6.13: about", "cm", ".3g"),
    Row("no slip, distance of the two over the plug's radius",
        "plug_stress/held/standard/6/distance_of_largest_sigma_1_and_eps_1_over_rp", None, "section 6.4: below 0.1",
        style=".2f"),
    Row("slip, height of the largest strain over h0",
        "plug_stress/frictionless/standard/6/largest_eps_1/Z_over_h0", None, "figure 6.11: in the middle", style=".2f"),
    Row("slip, R of the largest stress", "plug_stress/frictionless/standard/6/largest_sigma_1/R_cm", 1.905,
        "figure 6.11", "cm", ".3g", note="not reproduced"),
    Row("thin sheet at 3 cm, Treloar's constants over Throne's",
        "throne_plug/thin_treloar/held/force_N_at_travel_cm/3 OVER throne_plug/thin_throne/held/force_N_at_travel_cm/3",
        None,
        "figure 6.9: Throne's much softer", style=".3f", note="at most 1.18 is possible"),
]

PROGRAMS = [
    _program("ansys_vm56", "inner_displacement", "Ansys VM56: thick tube, inner displacement", "in", "its target"),
    _program("ansys_vm56", "radial_stress", "Ansys VM56: radial stress in the innermost fifth", "psi", "its target"),
    _program("ansys_vm201", "force_at_0.1", "Ansys VM201: bar between plates, force at 0.1 m", "N", "target: a graph"),
    _program("ansys_vm201", "force_at_0.2", "Ansys VM201: force at 0.2 m", "N", "target: a graph"),
    *(_program("ansys_vm218", f"height_at_{p}", f"Ansys VM218: plate, height at {p} psi", "in", "target: a graph")
      for p in ("4", "24", "38")),
    *(_program("code_aster_ssnv187a", law, f"code_aster SSNV187A: {words}, displacement", "", "its reference")
      for law, words in (("mooney_rivlin", "Mooney-Rivlin"), ("neo_hookean", "neo-Hookean"),
                         ("signorini", "Signorini"))),
    _program("solids4foam", "exact_inner_displacement", "solids4foam: neo-Hookean tube, inner displacement", "m",
             "its exact solution"),
    _program("solids4foam", "exact_hoop_stress_at_12", "solids4foam: hoop stress at R = 12 m", "MPa",
             "its exact solution"),
    _program("solids4foam", "nu_0.49_displacement", "solids4foam: Mooney tube, displacement at R = 7.15 m", "m",
             "its result, Poisson's ratio 0.49"),
    _program("solids4foam", "nu_0.49_hoop_stress", "solids4foam: hoop stress there", "MPa",
             "its result, Poisson's ratio 0.49"),
]

MEASURED = [
    Row(f"limit pressure of Treloar's sheet, {law}",
        f"measured_treloar/predicted/limit_pressure_kg_per_cm2/relative/{law}",
        "measured_treloar/measured/limit_pressure_kg_per_cm2/hemisphere", "equibiaxial test, 1944", "kg/cm²", ".3f")
    for law in LAWS
] + [
    Row("equibiaxial stress at stretch 2, Ogden by the uniaxial test alone",
        "measured_treloar/predicted/ogden_by_the_uniaxial_test_alone/equibiaxial_MPa_at_stretch_2",
        "measured_treloar/predicted/ogden_by_the_uniaxial_test_alone/measured_MPa_at_stretch_2", "the same test", "MPa",
        ".3f", note="the fit leaves constants undetermined, and says so"),
]

TABLES: dict[str, list[Row]] = {"exact": EXACT, "thesis": THESIS, "programs": PROGRAMS, "measured": MEASURED}
