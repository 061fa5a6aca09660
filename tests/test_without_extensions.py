"""The core and the readers without each extension: the package is imported and gives the same results."""

import subprocess
import sys

import numpy as np
import pytest
from conftest import ROOT
from without import run_without

import formingx as fx

MISSING = {"heat": ("Cooling", "ThermalExpansion", "heat"), "kbkz": ("KBKZ", "PSM"), "fits": ("fit", "treloar1944"),
           "release": ()}
METHODS = {"release": ("springback", "deformed_mesh", "to_msh")}
SCRIPT = """
import formingx as fx
print(fx.__file__)
warm = fx.Viscoelastic(fx.NeoHookean(c10=fx.table({120.0: 0.5, 160.0: 0.3})), [(0.4, 0.2)],
                       shift=fx.Arrhenius(80e3, 150.0, unit="C"))
scene = fx.Scene(mesh=fx.mesh.disc(radius=10.0, thickness=0.5, elements=(6, 1)), materials=warm,
                 temperature=lambda R, Z: 150.0 - R, supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")],
                 loads=[fx.Pressure("bottom", name="air")], contacts=[fx.Contact("top", fx.tools.plane(4.0), 0.2)])
path = fx.Process(scene).run([fx.Stage("blow", control="air", until=fx.pressure(0.05), duration=0.5)], progress=False)
print(path.part().volume, path.wall().wall.min(), len(path.stress().at_quadrature_points().points))
print(len(path), path.last.x.tobytes().hex())
"""
CORE = ("test_equations.py", "test_treloar.py", "test_contact_points.py", "test_time.py", "test_state_context.py")


@pytest.fixture(scope="module")
def whole():
    """Results of the whole package."""
    done = subprocess.run([sys.executable, "-c", SCRIPT], cwd=ROOT, capture_output=True, text=True, check=True)
    return done.stdout.splitlines()


@pytest.mark.thorough
@pytest.mark.parametrize("names", [tuple(MISSING), *(pytest.param((name,), marks=pytest.mark.slow)
                                                     for name in MISSING)])
def test_the_core_without_extensions(names, whole, tmp_path):
    """Without their folders a relaxing warm sheet blown against a plate ends in the same state, to the last bit."""
    things = [thing for name in names for thing in MISSING[name]]
    methods = [method for name in names for method in METHODS.get(name, ())]
    assert all(hasattr(fx, thing) for thing in things) and all(hasattr(fx.Path, method) for method in methods)
    absent = [f"assert not hasattr(fx, {thing!r})" for thing in things]
    absent += [f"assert not hasattr(fx.Path, {method!r})" for method in methods]
    file, *found = run_without(tmp_path, names, "-c", "\n".join([SCRIPT, *absent])).splitlines()
    assert file.startswith(str(tmp_path)) and found == whole[1:]
    assert np.frombuffer(bytes.fromhex(found[-1].split()[1])).max() > 0.1


@pytest.mark.slow
def test_tests_of_the_core_without_extensions(tmp_path):
    """Tests of the core pass without the four folders."""
    out = run_without(tmp_path, MISSING, "-m", "pytest", "-n", "0", "-q", "-x", "-p", "no:cacheprovider",
                      *(ROOT / "tests" / name for name in CORE))
    assert "[100%]" in out
