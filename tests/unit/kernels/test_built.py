"""A mistake in a kernel's source falls back to NumPy silently; continuous integration must not."""

import importlib.util
import os

import pytest

from retraverse import kernels


def test_compiled_kernels_are_there_in_continuous_integration() -> None:
    built = importlib.util.find_spec("retraverse.kernels._native") is not None
    if os.environ.get("CI") == "true":
        assert built, "the compiled kernels were not built; see what pip printed"
    elif not built:
        pytest.skip("no compiled kernels here: no C++ compiler when it was installed?")
    if os.environ.get("RETRAVERSE_KERNELS", "auto") != "numpy":
        assert kernels.backend() == "native"
        assert kernels.instruction_sets()[-1] == "plain"


def test_the_twin_can_be_forced(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RETRAVERSE_KERNELS", "numpy")
    assert kernels.backend() == "numpy"
