"""./fx: files that a command writes exist afterwards at the same path, or writing them fails with a message."""

import os
import subprocess
from pathlib import Path

import pytest
from conftest import ROOT


def fx(*command, cwd=ROOT, **environment):
    """Run ./fx as from outside."""
    outside = {k: v for k, v in os.environ.items() if k != "FX_INSIDE"} | environment
    return subprocess.run([ROOT / "fx", *map(str, command)], cwd=cwd, env=outside, capture_output=True, text=True,
                          timeout=100)


def built():
    """True if the Debian root that this runs in can be entered once more: only a real root user can."""
    cache = Path(os.environ.get("FX_CACHE") or Path(os.environ.get("XDG_DATA_HOME", Path.home() / ".local/share"))
                 / "formingx")
    here = os.stat("/").st_ino
    if os.getuid() != 0 or not any(root.is_dir() and root.stat().st_ino == here for root in cache.glob("*-*")):
        return False
    return subprocess.run(["unshare", "--mount", "true"], capture_output=True).returncode == 0


@pytest.fixture
def home_file():
    file = Path.home() / f"formingx-launcher-{os.getpid()}"
    yield file
    file.unlink(missing_ok=True)


@pytest.mark.skipif(not built(), reason="needs to run as root inside a Debian root that ./fx built")
def test_written_files_exist_at_their_paths(tmp_path, home_file):
    """In the temporary folder, beside and above the current one, at home; elsewhere it fails with words."""
    (tmp_path / "a" / "b c").mkdir(parents=True)
    places = ["here.csv", "../up.csv", "../../further up.csv", tmp_path / "x.csv", home_file]
    for place in places:
        done = fx("sh", "-c", 'echo "$1" > "$0"', place, "some text", cwd=tmp_path / "a" / "b c", FX="root")
        assert done.returncode == 0, done.stderr
        assert (tmp_path / "a" / "b c" / place).read_text() == "some text\n"
    for place in ("/etc/lost.csv", "/usr/lost.csv", "/lost.csv", "/var/lost.csv"):
        done = fx("sh", "-c", 'echo x > "$0"', place, cwd=tmp_path, FX="root")
        assert done.returncode != 0 and "Read-only file system" in done.stderr
    script = "import os, tempfile; print(os.getcwd(), os.path.expanduser('~'), tempfile.gettempdir())"
    inside = fx("python3", "-c", script, cwd=tmp_path, FX="root").stdout.split()
    assert inside == [str(tmp_path), str(Path.home()), os.environ.get("TMPDIR", "/tmp")]
    assert fx("sh", "-c", "exit 7", FX="root").returncode == 7


def test_container_mounts_the_writable_folders_alone(tmp_path):
    """The run line of an engine: all that a command may write is mounted, the rest of the container is read-only."""
    stub = tmp_path / "bin" / "docker"
    stub.parent.mkdir()
    stub.write_text("#!/bin/sh\n[ $1 = run ] || exit 0\nprintf '%s\\n' \"$@\"\n")
    stub.chmod(0o755)
    done = fx("echo", "two words", cwd=tmp_path, FX="docker", PATH=f"{stub.parent}:{os.environ['PATH']}",
              HOME="/home/some body")
    lines = done.stdout.splitlines()
    assert lines[0] == "run" and lines[-2:] == ["echo", "two words"] and "--read-only" in lines
    mounted = {line.split(":")[0] for before, line in zip(lines, lines[1:]) if before == "-v"}
    assert {f"/{path.split('/')[1]}" for path in (str(ROOT), str(tmp_path), "/home/some body", "/tmp")} <= mounted
    assert "HOME=/home/some body" in lines and lines[lines.index("-w") + 1] == str(tmp_path)


def test_only_ranks_of_mpirun_yield_the_core(tmp_path):
    """A run on one rank would otherwise lose the core to other processes in each of thousands of calls of MPI."""
    mpirun = tmp_path / "mpirun"
    mpirun.write_text("#!/bin/sh\necho [$OMPI_MCA_mpi_yield_when_idle]\n")
    mpirun.chmod(0o755)
    for command, shown in ((mpirun,), "[1]\n"), (("sh", mpirun), "[]\n"):
        done = fx(*command, FX_INSIDE="1", OMPI_MCA_mpi_yield_when_idle="")
        assert done.returncode == 0 and done.stdout == shown
