"""Build of the wheel: the files of the folder `wheel` belong beside the package, into `site-packages`."""

from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py


class BuildWithHook(build_py):
    """Copy of the package and of the import hook into the folder from which the wheel is made."""

    def run(self):
        """Copy the files; an editable installation has no hook."""
        super().run()
        if not self.editable_mode:
            for file in self._hook():
                self.copy_file(str(file), self.build_lib)

    def get_outputs(self, include_bytecode=True):
        """Return the paths of all files of the wheel."""
        return [*super().get_outputs(include_bytecode), *(f"{self.build_lib}/{file.name}" for file in self._hook())]

    @staticmethod
    def _hook():
        """Return the files of the import hook."""
        return sorted(Path(__file__).with_name("wheel").glob("*formingx*"))


setup(cmdclass={"build_py": BuildWithHook})
