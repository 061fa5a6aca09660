"""Scripts of tests on several ranks: one `mpirun` per number of ranks runs them all, one after the other.

Ranks that wait for a script wait for a message of the tests, not in MPI, where they would keep a core busy.
"""

import contextlib
import gc
import io
import os
import subprocess
import sys
import tempfile
import traceback
from multiprocessing.connection import Client, Connection, Listener, wait
from pathlib import Path

os.environ.setdefault("CFLAGS", "-O1")
"""Flags of all tests: forms compile in two thirds of the time of -O2, to the same bits; assembly takes 5 % longer."""

ENVIRONMENT = os.environ | {"OMPI_MCA_mpi_yield_when_idle": "1"}
"""Environment of `mpirun`, as `./fx mpirun` sets it: ranks that wait leave the core to others."""


class Ranks:
    """`mpirun -n size` of this file, and a line to each of its processes."""

    def __init__(self, size: int):
        self._folder = tempfile.TemporaryDirectory()
        self._lines: list[Connection] = []
        address, self._said = self._folder.name + "/socket", Path(self._folder.name, "said")
        with Listener(address, backlog=size) as listener, self._said.open("w") as said:
            listener._listener._socket.settimeout(300)
            self._process = subprocess.Popen(
                ["mpirun", "-n", str(size), sys.executable, __file__, address], cwd=Path(__file__).parents[1],
                env=ENVIRONMENT, stdin=subprocess.DEVNULL, stdout=said, stderr=said)
            try:
                self._lines = [listener.accept() for _ in range(size)]
                self._lines.sort(key=lambda line: line.recv())
            except BaseException:
                self.end()
                raise

    @property
    def alive(self) -> bool:
        return self._process.poll() is None

    def run(self, script: str, arguments: list[str], timeout: float) -> list[str]:
        """What each rank prints. A script that fails on a rank, or takes too long, ends them all."""
        printed = {}
        try:
            for line in self._lines:
                line.send((script, arguments))
            while len(printed) < len(self._lines):
                ready = wait([line for line in self._lines if line not in printed], timeout)
                assert ready, f"no answer of all ranks for {timeout} s"
                for line in ready:
                    printed[line], failed = line.recv()
                    assert not failed, f"rank {self._lines.index(line)}:\n{printed[line]}{failed}"
        except (AssertionError, EOFError, OSError) as error:
            raise AssertionError(f"{str(error) or 'a rank crashed'}\n{self.end(patience=1)}") from None
        return [printed[line] for line in self._lines]

    def end(self, patience: float = 20) -> str:
        """Hang up; processes that do not end by that are stopped. What they said beside what scripts print."""
        for line in self._lines:
            line.close()
        for stop, seconds in ((lambda: None, patience), (self._process.terminate, 20), (self._process.kill, 20)):
            stop()
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(seconds)
                break
        said = self._said.read_text()
        self._folder.cleanup()
        return said


def execute(script: str, arguments: list[str]) -> str:
    """What a script prints, with names of its own."""
    printed, before = io.StringIO(), sys.argv
    sys.argv = ["-c", *arguments]
    try:
        with contextlib.redirect_stdout(printed):
            exec(compile(script, "script", "exec"), {"__name__": "__main__"})
    finally:
        sys.argv = before
    return printed.getvalue()


def serve(line: Connection) -> None:
    """Run the scripts that come until the line is closed."""
    from mpi4py import MPI
    line.send(MPI.COMM_WORLD.rank)
    while True:
        try:
            script, arguments = line.recv()
        except EOFError:
            return
        printed, failed = "", ""
        try:
            printed = execute(script, arguments)
        except BaseException:
            failed = traceback.format_exc()
        gc.collect()                                # what PETSc holds is freed by all ranks at once
        line.send((printed, failed))


if __name__ == "__main__":
    serve(Client(sys.argv[1]))
