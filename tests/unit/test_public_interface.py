"""The top of the package: what it names exists, and importing it costs little."""

import subprocess
import sys

import pytest

import retraverse as rt

PROMISED = {
    "aligned", "build_map", "evaluate", "ground_truth", "load_map", "match",
    "match_similarity", "open_traverse", "similarity", "technique", "techniques",
}  # fmt: skip


def test_every_public_name_exists() -> None:
    for name in rt.__all__:
        assert getattr(rt, name) is not None
    assert set(rt.__all__) >= PROMISED
    assert dir(rt) == sorted(rt.__all__)


def test_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="relocate"):
        rt.relocate  # noqa: B018


def test_import_loads_nothing_heavy() -> None:
    heavy = "cv2", "matplotlib", "PIL", "torch", "safetensors", "jinja2", "typer", "rich"
    code = (
        "import sys, retraverse; retraverse.match; retraverse.evaluate; retraverse.techniques();"
        f"print(sorted(set({heavy!r}) & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
