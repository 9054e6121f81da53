"""Codings of descriptors: what arrives, in how many bytes, and what must be known before."""

import hashlib
import pickle
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from retraverse.errors import ConfigError, ShapeError
from retraverse.techniques import ArraySpec, Descriptions
from retraverse.techniques.sending import CODINGS, Coding, coding, coding_label, received
from retraverse.techniques.sending.sketch import Sketch
from retraverse.types import FloatArray

DIMENSION = 96
SPEC = ArraySpec((12, 8), "float32")
EVERY = [
    coding("exact"),
    coding("float16"),
    coding("int8"),
    coding("sketch", bits=64),
    coding("projected", dimensions=5),
]


def drawn(n_rows: int, seed: int = 3, dimension: int = DIMENSION) -> FloatArray:
    return np.random.default_rng(seed).normal(1, 2, (n_rows, dimension)).astype(np.float32)


def arrived(rows: FloatArray, chosen: Coding, known: FloatArray) -> FloatArray:
    queries, references = (Descriptions({"descriptor": one}) for one in (rows, known))
    return np.asarray(received(queries, references, chosen).descriptions.descriptor)


def test_every_coding_is_tried() -> None:
    assert {one.name for one in EVERY} == set(CODINGS)


@pytest.mark.parametrize("chosen", EVERY, ids=coding_label)
def test_messages_have_the_promised_length(chosen: Coding) -> None:
    known, rows = drawn(20), drawn(7, seed=4)
    coder = chosen.coder(known)
    messages = coder.encode(rows)
    assert messages.dtype == np.uint8
    assert messages.shape == (7, chosen.n_bytes(SPEC))
    # The message alone is enough, whatever array it comes in.
    again = np.array([np.frombuffer(bytes(row), np.uint8) for row in messages])
    np.testing.assert_array_equal(coder.decode(again), coder.decode(messages))
    assert coder.decode(messages).dtype == np.float32


@pytest.mark.parametrize("chosen", EVERY, ids=coding_label)
def test_frames_do_not_depend_on_their_neighbours(chosen: Coding) -> None:
    known, rows = drawn(20), drawn(70, seed=4)
    whole = arrived(rows, chosen, known)
    apart = np.concatenate([arrived(rows[i : i + 1], chosen, known) for i in range(70)])
    np.testing.assert_allclose(whole, apart, atol=1e-5)


@pytest.mark.parametrize("chosen", EVERY, ids=coding_label)
def test_nothing_stays_nothing(chosen: Coding) -> None:
    rows = drawn(4)
    rows[2] = 0
    there = arrived(rows, chosen, drawn(20))
    assert not there[2].any()
    assert there[[0, 1, 3]].any(axis=1).all()


@pytest.mark.parametrize("chosen", EVERY, ids=coding_label)
def test_it_can_be_sent_to_another_process(chosen: Coding) -> None:
    assert pickle.loads(pickle.dumps(chosen)) == chosen
    assert {field.name for field in fields(chosen)} == set(vars(chosen))  # type: ignore[arg-type]


@given(rows=arrays(np.float32, (3, 16), elements=st.floats(-1e6, 1e6, width=32)))
def test_numbers_arrive_within_their_step(rows: FloatArray) -> None:
    known = drawn(4, dimension=16)
    np.testing.assert_array_equal(arrived(rows, coding("exact"), known), rows)
    half = arrived(rows, coding("float16"), known)
    cut = np.clip(rows, -65504, 65504)
    assert (np.abs(half - cut) <= np.abs(cut) * 2**-11 + 2**-25).all()
    byte = arrived(rows, coding("int8"), known)
    largest = np.abs(rows).max(axis=1, keepdims=True)
    assert (np.abs(byte - rows) <= largest / 254 * 1.001 + 1e-37).all()


def sylvester(size: int) -> FloatArray:
    matrix = np.ones((1, 1), np.float32)
    while len(matrix) < size:
        matrix = np.block([[matrix, matrix], [matrix, -matrix]])
    return matrix


@pytest.mark.parametrize("bits", [16, 32, 80])
def test_a_sketch_is_the_sum_of_its_directions(bits: int) -> None:
    """Against the definition, with the Hadamard matrix written out."""
    hadamard = sylvester(32)
    coder = Sketch(bits=bits, seed=2).coder(drawn(1, dimension=30))
    directions = np.concatenate(
        [
            (hadamard @ np.diag(rotation.flips[1]) @ hadamard @ np.diag(rotation.flips[0]))[
                rotation.chosen, :30
            ]
            for rotation in coder.rotations
        ]
    )
    assert len(np.unique(directions, axis=0)) == len(directions) == bits
    rows = drawn(6, dimension=30)
    expected = np.sign(rows @ directions.T) @ directions
    lengths = [np.linalg.norm(one, axis=1, keepdims=True) for one in (rows, expected)]
    expected *= lengths[0] / lengths[1]
    np.testing.assert_allclose(coder.decode(coder.encode(rows)), expected, atol=1e-4)


def test_sketches_keep_who_is_alike() -> None:
    """P(same sign) = 1 - angle / pi (Charikar, 2002): shares of equal bits tell the angle."""
    dimension, bits = 4096, 4096
    one = drawn(1, seed=1, dimension=dimension) - 1
    other = drawn(1, seed=2, dimension=dimension) - 1
    mixed = (0.8 * one + 0.6 * other).astype(np.float32)
    coder = Sketch(bits=bits).coder(one)
    signs = [np.unpackbits(coder.encode(row)[0, 4:]) for row in (one, mixed)]
    cosine = float((one @ mixed.T).item() / np.linalg.norm(one) / np.linalg.norm(mixed))
    share = float((signs[0] == signs[1]).mean())
    # Binomial: four standard deviations.
    assert abs(share - (1 - np.arccos(cosine) / np.pi)) < 4 * 0.5 / np.sqrt(bits)


@pytest.mark.parametrize(
    "large", [[3, 1, 1], [3, *[0.3] * 63], [0.33, 0.33, 1, 0.33]], ids=["few", "one", "sparse"]
)
def test_sketches_of_few_large_numbers_point_where_they_do(large: list[float]) -> None:
    """Over seeds; one round of flips would leave the largest number alone."""
    row = np.zeros((1, 64), np.float32)
    row[0, : len(large)] = large
    arrivals = [
        coder.decode(coder.encode(row))[0]
        for coder in (Sketch(bits=64, seed=seed).coder(row) for seed in range(400))
    ]
    mean = np.mean(arrivals, axis=0)
    cosine = float(mean @ row[0] / np.linalg.norm(mean) / np.linalg.norm(row))
    assert cosine > 0.97


def test_the_directions_of_a_seed_are_fixed() -> None:
    """They are part of the format: whoever decodes may run another version of everything."""
    coder = Sketch(bits=24, seed=5).coder(drawn(1, dimension=16))
    assert len(coder.rotations) == 2
    for block, rotation in enumerate(coder.rotations):
        stream = hashlib.shake_256(f"retraverse sketch 5 {block}".encode()).digest(8 * 16)
        words = [int.from_bytes(stream[8 * i : 8 * i + 8], "little") for i in range(16)]
        for bit in range(2):
            wanted = [1 if word >> bit & 1 else -1 for word in words]
            assert rotation.flips[bit].tolist() == wanted
        ordered = sorted(range(16), key=lambda i: words[i] >> 2)
        assert rotation.chosen.tolist() == ordered[: (16, 8)[block]]
    other = Sketch(bits=24, seed=6).coder(drawn(1, dimension=16))
    assert other.rotations[0].chosen.tolist() != coder.rotations[0].chosen.tolist()


def test_a_projection_keeps_what_lies_in_the_map() -> None:
    """A map in three directions: what lies there too arrives, what does not is left out."""
    random = np.random.default_rng(8)
    basis = np.linalg.qr(random.normal(size=(DIMENSION, 4)))[0].T
    mean = random.normal(size=DIMENSION)
    known = (mean + random.normal(size=(200, 3)) @ basis[:3]).astype(np.float32)
    inside = (mean + random.uniform(-1, 1, (9, 3)) @ basis[:3]).astype(np.float32)
    beside = (inside + 5 * basis[3]).astype(np.float32)
    chosen = coding("projected", dimensions=8)
    there = arrived(inside, chosen, known)
    step = 4 * 1.2 / 127  # Of four standard deviations of about 1; half of it in each direction.
    assert np.linalg.norm(there - inside, axis=1).max() < step
    np.testing.assert_allclose(arrived(beside, chosen, known), there, atol=step)


def test_the_directions_are_the_principal_ones() -> None:
    known = drawn(40) * np.linspace(3, 0.1, DIMENSION, dtype=np.float32)
    coder = coding("projected", dimensions=6).coder(known)
    expected = np.linalg.svd(known - known.mean(axis=0), full_matrices=False)[2][:6]
    alignment = np.abs(np.sum(coder.directions * expected, axis=1))  # type: ignore[attr-defined]
    np.testing.assert_allclose(alignment, 1, atol=1e-5)


def test_frames_of_the_map_without_a_descriptor_teach_nothing() -> None:
    known, rows = drawn(20), drawn(6, seed=5)
    with_nothing = np.insert(known, [3, 9], 0, axis=0)
    chosen = coding("projected", dimensions=5)
    np.testing.assert_array_equal(arrived(rows, chosen, with_nothing), arrived(rows, chosen, known))
    assert not arrived(rows, chosen, 0 * known).any()


def test_both_ends_share_no_more_than_they_are_charged_for() -> None:
    coder = coding("projected", dimensions=5).coder(drawn(20))
    for values in vars(coder).values():
        np.testing.assert_array_equal(values, values.astype(np.float32))
    n_numbers = sum(values.size for values in vars(coder).values())
    assert 4 * n_numbers == coding("projected", dimensions=5).n_shared_bytes(SPEC)


@pytest.mark.parametrize("n_frames", [1, 2])
def test_a_map_of_few_frames_has_few_directions(n_frames: int) -> None:
    known = drawn(n_frames)
    there = arrived(drawn(3, seed=5), coding("projected", dimensions=9), known)
    assert np.isfinite(there).all()
    spread = np.linalg.matrix_rank(there - known.mean(axis=0), tol=1e-3)
    assert spread <= n_frames - 1


def test_what_both_ends_must_have() -> None:
    assert coding("sketch", bits=64).n_shared_bytes(SPEC) == 0
    # Mean and directions, and a step each, as float32.
    assert coding("projected", dimensions=5).n_shared_bytes(SPEC) == 4 * (6 * DIMENSION + 5)


def test_regions_are_kept_apart() -> None:
    regional = drawn(5).reshape(5, 12, 8)
    there = arrived(regional, coding("int8"), regional)
    assert there.shape == regional.shape
    np.testing.assert_allclose(there, regional, atol=np.abs(regional).max() / 127)


@pytest.mark.parametrize(
    ("name", "parameters", "message"),
    [
        ("int4", {}, r"unknown coding.*'int4'.*did you mean 'int8'"),
        ("sketch", {"bits": 12}, "bits: got 12, expected a multiple of 8"),
        ("sketch", {"bits": 0}, "bits: got 0"),
        ("sketch", {"seed": -1}, "seed: got -1"),
        ("sketch", {"bit": 8}, "did you mean 'bits'"),
        ("projected", {"dimensions": 0}, "dimensions: got 0, expected 1 to 511"),
    ],
)
def test_what_cannot_be(name: str, parameters: dict[str, int], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        coding(name, **parameters)


def test_bytes_are_sent_as_they_are_and_not_coded_again() -> None:
    rows = Descriptions({"descriptor": drawn(5).astype(np.uint8)})
    np.testing.assert_array_equal(
        received(rows, rows, coding("exact")).descriptions.descriptor, rows.descriptor
    )
    assert coding("exact").n_bytes(ArraySpec((12, 8), "uint8")) == 96
    with pytest.raises(ShapeError, match="got uint8, expected float32 to be sent as int8"):
        received(rows, rows, coding("int8"))
