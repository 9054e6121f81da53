"""Regions of interest in feature maps, and the VLAD of what lies under them.

References
----------
Khaliq, Ehsan, Chen, Milford, McDonald-Maier: A Holistic Visual Place Recognition Approach Using
Lightweight CNNs for Significant ViewPoint and Appearance Changes, T-RO 2020, section III.
"""

import numpy as np

from retraverse.errors import InputError
from retraverse.types import Array, FloatArray, IntArray

__all__ = ["build_clusters", "nearest_cluster", "region_features", "vlad_of_regions"]

_ROUNDS = 30
_BLOCK_VALUES = 1 << 22
"""How many distances are held at once."""


def region_features(maps: FloatArray, most: int) -> FloatArray:
    """Return what lies under the strongest regions of one picture, (regions, C).

    A region is a set of non-zero values of one map that touch, diagonally too; its strength is
    their mean. Under a region lies the sum, over its bounding box, of every map (equations 1-3).

    Parameters
    ----------
    maps : float32 array, shape (C, H, W)
        Feature maps after a ReLU.
    most : int
        Regions kept, strongest first; fewer if there are fewer.
    """
    boxes, strengths = _regions(maps)
    chosen = boxes[np.argsort(-strengths, kind="stable")[:most]]
    # Sums over boxes by the integral image, in float64 so that differences stay exact enough.
    integral = np.zeros((maps.shape[1] + 1, maps.shape[2] + 1, maps.shape[0]))
    integral[1:, 1:] = maps.transpose(1, 2, 0).astype(np.float64).cumsum(axis=0).cumsum(axis=1)
    top, left, bottom, right = chosen.T
    sums = (
        integral[bottom, right] - integral[top, right]
        - integral[bottom, left] + integral[top, left]
    )  # fmt: skip
    return np.asarray(sums, dtype=np.float32)


def _regions(maps: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the bounding box (top, left, bottom, right) and mean value of every region."""
    import cv2

    boxes, strengths = [np.empty((0, 4), np.int64)], [np.empty(0, np.float32)]
    for values in maps:
        count, labels, sizes, _ = cv2.connectedComponentsWithStats(
            (values > 0).astype(np.uint8), connectivity=8
        )
        if count < 2:
            continue
        totals = np.bincount(labels.ravel(), weights=values.ravel(), minlength=count)[1:]
        left, top, width, height, area = np.asarray(sizes[1:], np.int64).T
        boxes.append(np.stack([top, left, top + height, left + width], axis=1))
        strengths.append(np.asarray(totals / area, np.float32))
    return np.concatenate(boxes), np.concatenate(strengths)


def nearest_cluster(features: Array, centres: Array) -> IntArray:
    """Return the number of the nearest centre for every feature, the lowest of equals."""
    lengths = (centres.astype(np.float64) ** 2).sum(axis=1)
    step = max(1, _BLOCK_VALUES // len(centres))
    found = [
        (lengths - 2 * (features[start : start + step] @ centres.T)).argmin(axis=1)
        for start in range(0, len(features), step)
    ]
    return np.asarray(np.concatenate(found) if found else [], np.int64)


def vlad_of_regions(features: FloatArray, centres: FloatArray) -> FloatArray:
    """Return the residuals summed by cluster, roots with sign, one unit vector (V * C,).

    Parameters
    ----------
    features : float32 array, shape (regions, C)
    centres : float32 array, shape (V, C)
        The vocabulary.
    """
    sums = np.zeros(centres.shape, np.float64)
    words = nearest_cluster(features, centres)
    np.add.at(sums, words, features.astype(np.float64) - centres[words])
    vector = np.sign(sums) * np.sqrt(np.abs(sums))
    length = float(np.linalg.norm(vector))
    return np.asarray(vector.ravel() / (length or 1.0), dtype=np.float32)


def build_clusters(features: FloatArray, count: int, *, seed: int = 0) -> FloatArray:
    """Return `count` centres of features by k-means, started by k-means++.

    Parameters
    ----------
    features : float32 array, shape (N, C)
        At least `count` different rows.
    count : int
    seed : int
        The same seed and features give the same centres.

    Raises
    ------
    InputError
        If there are too few different features.

    References
    ----------
    Arthur, Vassilvitskii: k-means++: The Advantages of Careful Seeding, SODA 2007.
    """
    centres = _spread(features.astype(np.float64), count, np.random.default_rng(seed))
    words = nearest_cluster(features, centres)
    for _ in range(_ROUNDS):
        sums = np.zeros_like(centres)
        np.add.at(sums, words, features)
        counts = np.bincount(words, minlength=count)[:, np.newaxis]
        # A cluster that lost all its features stays where it was.
        centres = np.where(counts > 0, sums / np.maximum(counts, 1), centres)
        previous, words = words, nearest_cluster(features, centres)
        if (words == previous).all():
            break
    return np.asarray(centres, dtype=np.float32)


def _spread(features: Array, count: int, random: np.random.Generator) -> Array:
    """Return first centres, each drawn by its squared distance to those before it."""
    chosen = [int(random.integers(len(features)))] if len(features) else []
    distances = np.full(len(features), np.inf)
    while len(chosen) < count:
        if chosen:
            steps = features - features[chosen[-1]]
            distances = np.minimum(distances, (steps * steps).sum(axis=1))
        total = distances.sum()
        if not len(features) or total <= 0:
            raise InputError(
                f"vocabulary: {len(chosen)} different features in all, expected at least {count}; "
                "give more pictures, or ask for fewer words"
            )
        chosen.append(int(random.choice(len(features), p=distances / total)))
    return features[chosen]
