"""`retraverse doctor`: what this installation is and whether it is the fast one."""

import platform
from importlib.metadata import version

from retraverse import kernels
from retraverse._version import __version__
from retraverse.cli.options import JsonOutput
from retraverse.cli.output import print_json, print_table

__all__ = ["doctor"]

PACKAGES = ("numpy", "opencv-python-headless", "pillow", "safetensors", "matplotlib")


def doctor(json_output: JsonOutput = False) -> None:
    """Say what is installed, which kernels run, and on how many threads."""
    findings = {
        "retraverse": __version__,
        "python": platform.python_version(),
        "machine": f"{platform.machine()}, {platform.system()}",
        "kernels": kernels.backend(),
        "instruction sets": ", ".join(kernels.instruction_sets()) or "none",
        "threads": str(kernels.default_threads()),
        **{package: version(package) for package in PACKAGES},
    }
    if json_output:
        print_json(findings)
        return
    print_table([[key, value] for key, value in findings.items()], head=("", ""))
    if kernels.backend() == "numpy":
        print("the compiled kernels are not here: everything works, several times slower; install")
        print("a C++ compiler and reinstall retraverse to build them")
