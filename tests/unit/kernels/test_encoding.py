"""Regional HOG and entropies: what they must be on pictures whose answer is known."""

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from retraverse.errors import ConfigError, ShapeError
from retraverse.kernels import (
    encoding,
    local_entropy,
    numpy_encoding,
    region_entropies,
    regional_hog,
)
from retraverse.kernels.backend import native

BLOCK = (slice(1, -1), slice(1, -1))  # regions whose pixels see no border


@pytest.fixture(params=["native", "numpy"])
def kernels_in_use(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.param == "numpy":
        monkeypatch.setattr(encoding, "native", lambda: None)
    elif native() is None:
        pytest.skip("no compiled kernels here")


def noise(seed: int, *shape: int, low: int = 0, high: int = 256) -> Any:
    print("seed", seed)
    return np.random.default_rng(seed).integers(low, high, shape, dtype=np.uint8)


def regions(descriptor: Any, bins: int = 8) -> Any:
    """Descriptors as [region row, region column, cell row, cell column, bin]."""
    side = round(len(descriptor) ** 0.5)
    return descriptor.reshape(side, side, 2, 2, bins)


def blurred(seed: int, size: int) -> Any:
    return cv2.GaussianBlur(noise(seed, size, size), (0, 0), 2.0)


@pytest.mark.usefixtures("kernels_in_use")
class TestRegionalHog:
    @pytest.mark.parametrize(
        ("size", "cell", "n_regions"),
        [(512, 16, 961), (1024, 16, 3969), (32, 16, 1), (16, 16, 0), (0, 16, 0), (24, 8, 4)],
    )
    def test_regions_follow_from_the_size(self, size: int, cell: int, n_regions: int) -> None:
        descriptor = regional_hog(noise(1, size, size), cell=cell)
        assert descriptor.shape == (n_regions, 32)
        assert descriptor.dtype == np.float32

    @pytest.mark.parametrize("level", [0, 1, 77, 255])
    def test_a_flat_picture_has_no_gradient(self, level: int) -> None:
        assert not regional_hog(np.full((64, 64), level, np.uint8)).any()

    def test_a_flat_part_of_a_picture_has_none_either(self) -> None:
        grey = np.full((96, 96), 77, np.uint8)
        grey[:10, :10] = noise(2, 10, 10)
        descriptor = regions(regional_hog(grey))
        assert descriptor[0, 0].any()
        assert not descriptor[1:, 1:].any()

    def test_gradients_that_cancel_leave_nothing_with_the_mean_magnitude(self) -> None:
        y, x = np.mgrid[:96, :96]
        stripes = (127 + 90 * np.sin((x - y) / 5)).astype(np.uint8)
        inner = regions(regional_hog(stripes))[BLOCK]
        assert not inner.any()
        inner = regions(regional_hog(stripes, magnitude="euclidean"))[BLOCK]
        assert inner[..., 3].all()  # along (1, -1): 315 degrees, or 135
        assert inner[..., 7].all()

    @pytest.mark.parametrize(
        ("quarter_turns", "signed_bin", "unsigned_bin"),
        [(0, 0, 0), (1, 6, 4), (2, 4, 0), (3, 2, 4)],
    )
    def test_angle_zero_is_brighter_to_the_right_and_grows_towards_brighter_below(
        self, quarter_turns: int, signed_bin: int, unsigned_bin: int
    ) -> None:
        ramp = np.tile(np.arange(64, dtype=np.uint8) * 3, (64, 1))
        grey = np.rot90(ramp, quarter_turns)
        for orientation, best in (("signed", signed_bin), ("unsigned", unsigned_bin)):
            descriptor = regions(regional_hog(grey, orientation=orientation))[1, 1]  # type: ignore[arg-type]
            assert descriptor[..., best].all()
            assert not np.delete(descriptor, best, axis=-1).any()

    @pytest.mark.parametrize("magnitude", ["mean", "euclidean"])
    def test_transposing_the_picture_mirrors_the_angles(self, magnitude: Any) -> None:
        grey = blurred(3, 80)
        here = regions(regional_hog(grey, magnitude=magnitude))
        there = regions(regional_hog(grey.T, magnitude=magnitude))
        mirrored = there.transpose(1, 0, 3, 2, 4)[..., (2 - np.arange(8)) % 8]
        np.testing.assert_allclose(here, mirrored, atol=1e-6)

    def test_unsigned_bins_of_double_number_fold_the_signed_ones(self) -> None:
        grey = blurred(4, 64)
        signed = regions(regional_hog(grey, bins=12), 12)
        unsigned = regions(regional_hog(grey, bins=6, orientation="unsigned"), 6)
        folded = signed[..., :6] + signed[..., 6:]
        folded /= np.sqrt((folded**2).sum(axis=(2, 3, 4), keepdims=True))
        np.testing.assert_allclose(unsigned, folded, atol=1e-6)

    def test_brightness_scale_does_not_matter(self) -> None:
        grey = noise(5, 64, 64, high=128)
        np.testing.assert_array_equal(regional_hog(grey), regional_hog(grey * 2))

    @pytest.mark.parametrize("bins", [1, 2, 5, 8, 9, 36])
    @pytest.mark.parametrize("orientation", ["signed", "unsigned"])
    def test_rows_have_length_one(self, bins: int, orientation: Any) -> None:
        descriptor = regional_hog(noise(6, 48, 48), bins=bins, orientation=orientation)
        assert descriptor.shape == (4, 4 * bins)
        assert descriptor.min() >= 0
        np.testing.assert_allclose(np.linalg.norm(descriptor, axis=1), 1, atol=1e-6)

    def test_a_view_and_a_read_only_picture_are_taken(self) -> None:
        wide = noise(7, 64, 128)
        view = wide[:, ::2]
        view.flags.writeable = False
        np.testing.assert_array_equal(regional_hog(view), regional_hog(view.copy()))

    def test_many_threads_may_call_at_once(self) -> None:
        grey = noise(8, 128, 128)
        with ThreadPoolExecutor(4) as pool:
            results = list(pool.map(regional_hog, [grey] * 16))
        for result in results:
            np.testing.assert_array_equal(result, results[0])

    @pytest.mark.parametrize(
        ("grey", "parameters", "error", "message"),
        [
            (np.zeros((64, 32), np.uint8), {}, ShapeError, r"\(64, 32\); expected a square"),
            (np.zeros((40, 40), np.uint8), {}, ShapeError, "40; expected a multiple of the cell"),
            (np.zeros((64, 64)), {}, ShapeError, "float64 of shape .* expected uint8"),
            (np.zeros((64, 64, 3), np.uint8), {}, ShapeError, "was it converted to grey"),
            (np.zeros((64, 64), np.uint8), {"bins": 0}, ConfigError, "bins is 0; expected 1 to"),
            (np.zeros((64, 64), np.uint8), {"cell": 1}, ConfigError, "cell is 1; expected at"),
            (
                np.zeros((64, 64), np.uint8),
                {"orientation": "both"},
                ConfigError,
                "expected one of signed, unsigned",
            ),
            (
                np.zeros((64, 64), np.uint8),
                {"magnitude": "max"},
                ConfigError,
                "expected one of mean, euclidean",
            ),
        ],
    )
    def test_wrong_input_is_one_clear_line(
        self, grey: Any, parameters: Any, error: type[Exception], message: str
    ) -> None:
        with pytest.raises(error, match=message) as caught:
            regional_hog(grey, **parameters)
        assert "\n" not in str(caught.value)


@pytest.mark.usefixtures("kernels_in_use")
class TestLocalEntropy:
    @pytest.mark.parametrize("shape", [(1, 1), (1, 30), (30, 1), (12, 30)])
    def test_one_level_has_none(self, shape: tuple[int, int]) -> None:
        assert not local_entropy(np.full(shape, 200, np.uint8)).any()

    def test_all_levels_different_is_log2_of_the_disk(self) -> None:
        grey = np.arange(225, dtype=np.uint8).reshape(15, 15)
        entropy = local_entropy(grey)
        assert entropy[7, 7] == pytest.approx(np.log2(81), abs=1e-12)
        # a quarter of the disk and its two straight edges: (81 - 1) / 4 + 5 + 1
        assert entropy[0, 0] == pytest.approx(np.log2(26), abs=1e-12)

    def test_two_levels_in_equal_parts_is_one_bit(self) -> None:
        grey = np.zeros((1, 40), np.uint8)
        grey[0, ::2] = 9
        assert local_entropy(grey)[0, 2] == pytest.approx(1.0, abs=1e-12)  # columns 0..7

    def test_the_order_of_levels_does_not_matter(self) -> None:
        grey = noise(9, 20, 31)
        shuffled = np.random.default_rng(9).permutation(256).astype(np.uint8)[grey]
        np.testing.assert_allclose(local_entropy(shuffled), local_entropy(grey), atol=1e-12)

    def test_largest_radius(self) -> None:
        entropy = local_entropy(np.arange(200, dtype=np.uint8).reshape(10, 20), radius=100)
        np.testing.assert_allclose(entropy, np.log2(200), atol=1e-12)

    @pytest.mark.parametrize(
        ("grey", "radius", "error", "message"),
        [
            (np.zeros((4, 4)), 5, ShapeError, "expected uint8"),
            (np.zeros((0, 4), np.uint8), 5, ShapeError, "no pixels"),
            (np.zeros((4, 4), np.uint8), 0, ConfigError, "radius is 0; expected 1 to 100"),
            (np.zeros((4, 4), np.uint8), 101, ConfigError, "radius is 101"),
        ],
    )
    def test_wrong_input_is_one_clear_line(
        self, grey: Any, radius: int, error: type[Exception], message: str
    ) -> None:
        with pytest.raises(error, match=message):
            local_entropy(grey, radius=radius)


class TestRegionEntropies:
    @pytest.mark.parametrize(
        ("shape", "size", "cell"),
        [((100, 100), 512, 16), ((100, 100), 1024, 16), ((100, 100), 64, 16), ((37, 53), 96, 8)],
    )
    def test_same_as_resizing_the_map_and_averaging_windows(
        self, shape: tuple[int, int], size: int, cell: int
    ) -> None:
        entropy_map = np.random.default_rng(10).uniform(0, 6, shape)
        large = cv2.resize(entropy_map, (size, size), interpolation=cv2.INTER_LINEAR)
        starts = range(0, size - cell, cell)
        expected = [
            large[a : a + 2 * cell, b : b + 2 * cell].mean() / 8 for a in starts for b in starts
        ]
        local, whole = region_entropies(entropy_map, size=size, cell=cell)
        np.testing.assert_allclose(local, expected, atol=1e-9)
        assert whole == pytest.approx(large.mean() / 8, abs=1e-9)

    def test_one_region_and_none(self) -> None:
        entropy_map = np.full((100, 100), 4.0)
        assert region_entropies(entropy_map, size=32)[0] == pytest.approx([0.5])
        none, whole = region_entropies(entropy_map, size=16)
        assert none.shape == (0,)
        assert whole == pytest.approx(0.5)

    def test_a_map_of_one_sample(self) -> None:
        local, whole = region_entropies(np.full((1, 1), 8.0), size=64)
        np.testing.assert_allclose(local, np.ones(9))
        assert whole == pytest.approx(1.0)

    def test_wrong_input_is_one_clear_line(self) -> None:
        with pytest.raises(ShapeError, match=r"\(4,\); expected \(height, width\)"):
            region_entropies(np.zeros(4))
        with pytest.raises(ShapeError, match="500; expected a multiple of the cell, 16"):
            region_entropies(np.zeros((4, 4)), size=500)


needs_native = pytest.mark.skipif(native() is None, reason="no compiled kernels here")


@needs_native
class TestTwins:
    """The compiled kernels, on every instruction set of this processor, against NumPy."""

    @given(
        st.integers(0, 2**32),
        st.sampled_from([(16, 8), (32, 16), (36, 4), (30, 3), (10, 2), (66, 11), (160, 16)]),
        st.integers(1, 20),
        st.booleans(),
        st.booleans(),
        st.sampled_from([2, 3, 30, 256]),
    )
    def test_regional_hog(
        self,
        seed: int,
        sizes: tuple[int, int],
        bins: int,
        signed: bool,
        euclidean: bool,
        levels: int,
    ) -> None:
        size, cell = sizes
        grey = noise(seed, size, size, high=levels)
        expected = np.zeros(((size // cell - 1) ** 2, 4 * bins), np.float32)
        numpy_encoding.regional_hog(grey, expected, cell, bins, signed, euclidean)
        compiled: Any = native()
        for name in compiled.encoding_instruction_sets():
            got = np.zeros_like(expected)
            compiled.regional_hog(grey, got, cell, bins, signed, euclidean, name)
            np.testing.assert_allclose(got, expected, atol=5e-6, err_msg=name)

    @given(
        st.integers(0, 2**32),
        st.integers(1, 40),
        st.integers(1, 40),
        st.integers(1, 12),
        st.sampled_from([1, 2, 30, 256]),
    )
    def test_local_entropy(
        self, seed: int, height: int, width: int, radius: int, levels: int
    ) -> None:
        image = noise(seed, height, width, high=levels)
        expected, got = np.empty((2, height, width))
        numpy_encoding.local_entropy(image, expected, radius)
        compiled: Any = native()
        compiled.local_entropy(image, got, radius)
        np.testing.assert_allclose(got, expected, atol=1e-12)

    def test_an_unknown_instruction_set_is_refused(self) -> None:
        compiled: Any = native()
        grey, out = np.zeros((32, 32), np.uint8), np.zeros((1, 32), np.float32)
        with pytest.raises(ValueError, match="does not run"):
            compiled.regional_hog(grey, out, 16, 8, True, False, "mmx")
