"""What a user does with an installed formingx: README's pot, its notebook, `check`, two ranks, other imports first.

    python3 try_wheel.py CHECKOUT DIST
"""

import re
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

checkout, dist = map(Path, sys.argv[1:])
sys.path.append(str(checkout / "tests"))
from printed import assert_shows  # noqa: E402

HERE = Path(sys.executable).parent


def run(*command):
    """Return what a command prints; it must succeed."""
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
    return done.stdout


def test_files():
    """The wheel and the source archive contain all files of the package."""
    package = {f.relative_to(checkout).as_posix() for f in (checkout / "formingx").rglob("*")
               if f.is_file() and f.suffix != ".pyc"}
    wheel, = dist.glob("*.whl")
    source, = dist.glob("*.tar.gz")
    with tarfile.open(source) as archive:
        inside = {name.partition("/")[2] for name in archive.getnames()}
    assert package | {"formingx.pth", "_formingx_first.py"} <= {*zipfile.ZipFile(wheel).namelist()}
    assert package | {"fx", "tests/conftest.py", "docs/install.md", "demos/treloar.py", "wheel/formingx.pth"} <= inside


def test_readme():
    """README's script prints what README shows, writes a picture and a report, and is without findings of `check`."""
    script, shown = re.search(r"```python\n(.*?)```\n\n```text\n(.*?)```", (checkout / "README.md").read_text(),
                              re.S).groups()
    Path("pot.py").write_text(script)
    assert_shows(shown, run(sys.executable, "pot.py"))
    assert Path("pot.png").stat().st_size > 20_000 and Path("pot.html").stat().st_size > 20_000
    assert "error" not in run(HERE / "formingx", "check", "pot.py").lower()


def test_two_ranks():
    """The same numbers, though the script imports DOLFINx first."""
    Path("two.py").write_text("""
import dolfinx, petsc4py.PETSc
import formingx as fx
assert "site-packages" in fx.__file__
scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.1, elements=(12, 2)), materials=fx.NeoHookean(c10=1.0),
                 supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom")])
path = fx.trace(scene, until=fx.pole_stretch(3.0), progress=False)
if path.problem.comm.rank == 0:
    print(path.problem.comm.size, f"{path['pressure'].max():.9g} {path['pole_height'][-1]:.9g}")
""")
    one, two = run(sys.executable, "two.py").split(), run(HERE / "mpiexec", "-n", 2, sys.executable, "two.py").split()
    assert one[0] == "1" and two[0] == "2" and one[1:] == two[1:], (one, two)


def test_notebook():
    """The notebook runs as it is."""
    import nbformat
    from nbclient import NotebookClient
    book = nbformat.read(checkout / "docs" / "notebooks" / "pot.ipynb", as_version=4)
    NotebookClient(book, kernel_name="python3").execute()
    assert Path("pot.mp4").stat().st_size > 10_000


for test in (test_files, test_readme, test_two_ranks, test_notebook):
    test()
    print(test.__name__, "passed", flush=True)
