"""Scenes and meshes, which are folders at the top of a checkout, go into wheels next to the code."""

from pathlib import Path
from shutil import copytree

from setuptools import setup
from setuptools.command.build_py import build_py


class BuildWithData(build_py):
    """Build step that copies the code, and for wheels the data; an editable installation reads the checkout."""

    def run(self) -> None:
        """Copy all that the distribution holds into the build folder."""
        super().run()
        if not self.editable_mode:
            for name in ("meshes", "scenes"):
                copytree(name, Path(self.build_lib, "flexclear", name), dirs_exist_ok=True)


setup(cmdclass={"build_py": BuildWithData})
