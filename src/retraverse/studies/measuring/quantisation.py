"""JPEG quantisation tables tuned for one technique, on the reference drive alone.

No query and no label is looked at. What is sought are the 64 + 64 steps with which a compressed
picture of the map still resembles its clean neighbours in the map more than far places do, at the
bytes that the standard's tables take.

The picture in steps:

1. some frames, evenly spread, are the probes; the whole map is described clean, once;
2. the steps are in 16 groups (`STEP_GROUPS`): frequencies that belong together, luminance by
   direction; a candidate multiplies each group's standard steps by a factor;
3. every candidate is brought to the standard's bytes by one common factor;
4. probes are compressed, described and compared with the clean map; the *margin* is how far their
   neighbours (not themselves) stand above far places, in standard deviations of the latter;
5. one group after the other is tried coarser and finer, and kept where the margin grows.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from retraverse.errors import ConfigError, InputError
from retraverse.images import (
    Encoder,
    Frame,
    QuantisationTables,
    Traverse,
    Worsening,
    encode_jpeg,
    worsened,
)
from retraverse.images.jpeg import check_compression
from retraverse.images.picture_cache import native_pixels
from retraverse.images.quantisation import STANDARD_TABLES
from retraverse.maps.describe import describe_traverse
from retraverse.techniques import Descriptions, Technique
from retraverse.types import Array, FloatArray, ImageArray, IntArray, Progress, no_progress

__all__ = [
    "STEP_GROUPS",
    "TunedTables",
    "TuningPlan",
    "fit_bytes",
    "margin",
    "scaled_groups",
    "tune_tables",
]

N_REFERENCES = 300
"""Map frames that are compared against at most, evenly spread; bounds the time of one trial."""
FIT_STEPS = 8
"""Halvings of the common factor's interval."""
N_WEIGHED = 12
"""Probes whose bytes are fitted in a trial; the tables found are fitted to all."""


def _groups() -> tuple[tuple[str, Array], ...]:
    """Return (name, mask over the 128 steps) of every group."""
    v, u = np.mgrid[0:8, 0:8]
    band, none = u + v, np.zeros((8, 8), bool)
    masks = [("luminance mean", (band == 0, none))]
    for first, last in ((1, 1), (2, 2), (3, 3), (4, 5), (6, 8), (9, 14)):
        inside = (band >= first) & (band <= last)
        for name, half in (("across", u >= v), ("down", u < v)):
            masks.append((f"luminance {first} to {last} {name}", (inside & half, none)))
    masks += [
        ("colour mean", (none, band == 0)),
        ("colour 1 to 3", (none, (band >= 1) & (band <= 3))),
        ("colour 4 to 14", (none, band >= 4)),
    ]
    return tuple((name, np.concatenate([one.ravel() for one in pair])) for name, pair in masks)


STEP_GROUPS = _groups()
"""Name and mask, bool (128,), of the groups of steps that are changed together."""


@dataclass(frozen=True)
class TuningPlan:
    """How tables are tuned."""

    compression: int = 95
    """c whose bytes (with the standard's tables) are to be met."""
    n_probes: int = 24
    """Frames of the map that are compressed in each trial."""
    neighbours: int = 2
    """Frames up to so many away show the probe's place."""
    far: int = 8
    """Frames from so many away on show other places."""
    factors: tuple[float, ...] = (2.0, 1.4)
    """Each pass tries every group coarser and finer by its factor."""
    encoder: Encoder = field(default_factory=lambda: Encoder(optimize=True))
    """Its tables are replaced."""

    def __post_init__(self) -> None:
        """Check every range."""
        check_compression(self.compression)
        if not 1 <= self.neighbours < self.far:
            raise ConfigError(
                f"tuning: got neighbours {self.neighbours} and far {self.far}, expected "
                "1 <= neighbours < far"
            )
        if self.n_probes < 2 or any(not factor > 1 for factor in self.factors):
            raise ConfigError("tuning: expected at least 2 probes and factors above 1")

    @property
    def n_trials(self) -> int:
        """How many candidates are tried at most, the standard included."""
        return 1 + 2 * len(self.factors) * len(STEP_GROUPS)


@dataclass(frozen=True)
class TunedTables:
    """The tables found, and how they compare on the probes."""

    tables: QuantisationTables
    """To be used at c = 50, where the tables in the file are these."""
    standard: QuantisationTables
    """The standard's tables at the plan's c, in the same form."""
    n_bytes: float
    """Mean bytes of a probe."""
    n_bytes_standard: float
    margin: float
    """Standard deviations by which neighbours stand above far places."""
    margin_standard: float
    factors: tuple[float, ...]
    """What each of `STEP_GROUPS` was multiplied by, before the common factor."""
    n_trials: int


def tune_tables(
    reference: Traverse,
    technique: Technique,
    plan: TuningPlan | None = None,
    *,
    progress: Progress = no_progress,
) -> TunedTables:
    """Return quantisation tables tuned for a technique on one drive, at the standard's bytes.

    Parameters
    ----------
    reference : Traverse
        The map's pictures; colour files are tuned in colour, grey ones in grey.
    technique : Technique
        With a global or regional descriptor.
    plan : TuningPlan, optional
    progress : Progress
        Called with the trials.

    Raises
    ------
    InputError
        If the drive is too short for neighbours and far places.
    FrameReadError
        If a picture cannot be read.
    """
    plan = plan or TuningPlan()
    bench = _Bench(reference, technique, plan)
    factors = np.ones(len(STEP_GROUPS))
    best = bench.try_factors(factors)
    first = best
    moves = [
        (group, step)
        for factor in plan.factors
        for group in range(len(STEP_GROUPS))
        for step in (factor, 1 / factor)
    ]
    for group, step in progress(moves, total=len(moves), label="tuning quantisation tables"):
        candidate = factors.copy()
        candidate[group] *= step
        found = bench.try_factors(candidate)
        if found.margin > best.margin:
            best, factors = found, candidate
    tables, n_bytes = bench.standard, bench.n_bytes_standard
    if (factors != 1).any():
        tables, n_bytes = bench.at_standard_bytes(best.tables)
    return TunedTables(
        tables=replace(tables, name=f"{technique.name}-c{plan.compression}"),
        standard=bench.standard,
        n_bytes=n_bytes,
        n_bytes_standard=bench.n_bytes_standard,
        margin=bench.margin(tables),
        margin_standard=first.margin,
        factors=tuple(float(factor) for factor in factors),
        n_trials=plan.n_trials,
    )


def scaled_groups(tables: QuantisationTables, factors: Sequence[float] | Array) -> Array:
    """Return the 128 steps of two tables with each group multiplied by its factor, float64."""
    steps = np.array(tables.luminance + tables.chrominance, np.float64)
    for (_, mask), factor in zip(STEP_GROUPS, np.asarray(factors), strict=True):
        steps[mask] *= factor
    return steps


def fit_bytes(
    pictures: Sequence[ImageArray], steps: Array, n_bytes: float, encoder: Encoder
) -> tuple[QuantisationTables, float]:
    """Return the finest multiple of the steps at which pictures take no more than `n_bytes`.

    Parameters
    ----------
    pictures : sequence of uint8 pictures
    steps : float array, shape (128,)
        Luminance and chrominance steps, rounded to 1..255 after multiplying.
    n_bytes : float
        Mean bytes of a picture that are not to be exceeded.
    encoder : Encoder
        Its tables are replaced.

    Returns
    -------
    tables : QuantisationTables
        For c = 50. The coarsest there are (all steps 255) if even those take more.
    mean_bytes : float
        What the pictures take with them.
    """
    low, high = np.log(1 / steps.max()), np.log(255 / steps.min())
    fitting = _tables(steps * np.exp(high))
    fitting_bytes = _mean_bytes(pictures, fitting, encoder)
    for _ in range(FIT_STEPS):
        middle = (low + high) / 2
        tables = _tables(steps * np.exp(middle))
        taken = _mean_bytes(pictures, tables, encoder)
        if taken <= n_bytes:
            high, fitting, fitting_bytes = middle, tables, taken
        else:
            low = middle
    return fitting, fitting_bytes


def margin(scores: FloatArray, probes: IntArray, frames: IntArray, plan: TuningPlan) -> float:
    """Return how far neighbours stand above far places, in standard deviations of the latter.

    Parameters
    ----------
    scores : float array, shape (P, R)
        Similarity of compressed probes and clean map frames.
    probes, frames : int64 arrays, shapes (P,) and (R,)
        Their numbers in the map. A probe's own clean picture does not count.
    """
    apart = np.abs(probes[:, np.newaxis] - frames[np.newaxis, :])
    near = (apart >= 1) & (apart <= plan.neighbours)
    far = apart >= plan.far
    values = []
    for row, is_near, is_far in zip(scores.astype(np.float64), near, far, strict=True):
        spread = row[is_far].std()
        values.append((row[is_near].mean() - row[is_far].mean()) / max(spread, 1e-9))
    # The median: a few probes in a tunnel or at a stop should not decide.
    return float(np.median(values))


@dataclass(frozen=True)
class _Trial:
    tables: QuantisationTables
    margin: float


class _Bench:
    """The clean map, the probes and their bytes by the standard's tables."""

    def __init__(self, reference: Traverse, technique: Technique, plan: TuningPlan) -> None:
        if len(reference) <= plan.far + plan.neighbours:
            raise InputError(
                f"{reference.name}: got {len(reference)} frames, expected more than "
                f"{plan.far + plan.neighbours} to tune on"
            )
        self._technique, self._plan = technique, plan
        self._probes = _spread(len(reference), plan.n_probes)
        self._frames = _with_neighbours(
            _spread(len(reference), N_REFERENCES), self._probes, plan.neighbours, len(reference)
        )
        self._clean = _describe(reference.take(self._frames), technique)
        pictures = [native_pixels(reference[row].pixels) for row in self._probes.tolist()]
        self._pictures = pictures
        frames = tuple(Frame.from_array(one, index=i) for i, one in enumerate(pictures))
        self._probe_frames = Traverse("probes", f"probes of {reference.source}", frames)
        luminance, chrominance = STANDARD_TABLES.at_quality(100 - plan.compression)
        self.standard = QuantisationTables(luminance, chrominance, "standard")
        self.n_bytes_standard = _mean_bytes(pictures, self.standard, plan.encoder)
        self._weighed = pictures[:: max(1, len(pictures) // N_WEIGHED)]
        self._weighed_bytes = _mean_bytes(self._weighed, self.standard, plan.encoder)

    def try_factors(self, factors: Array) -> _Trial:
        """Return the tables of these factors at about the standard's bytes, and their margin."""
        tables = self.standard
        if (factors != 1).any():
            steps = scaled_groups(self.standard, factors)
            tables, _ = fit_bytes(self._weighed, steps, self._weighed_bytes, self._plan.encoder)
        return _Trial(tables, self.margin(tables))

    def at_standard_bytes(self, tables: QuantisationTables) -> tuple[QuantisationTables, float]:
        """Return the tables scaled so that all probes take no more than the standard's bytes."""
        steps = np.array(tables.luminance + tables.chrominance, np.float64)
        return fit_bytes(self._pictures, steps, self.n_bytes_standard, self._plan.encoder)

    def margin(self, tables: QuantisationTables) -> float:
        """Return the margin of the probes compressed with these tables."""
        way = Worsening(compression=50, encoder=_encoder(self._plan.encoder, tables))
        described = _describe(worsened(self._probe_frames, way), self._technique)
        scores = self._technique.similarity(described, self._clean)
        return margin(scores, self._probes, self._frames, self._plan)


def _spread(n_frames: int, count: int) -> IntArray:
    return np.unique(np.linspace(0, n_frames - 1, min(count, n_frames)).astype(np.int64))


def _with_neighbours(
    frames: IntArray, probes: IntArray, neighbours: int, n_frames: int
) -> IntArray:
    """Return the frames and every probe's neighbours, sorted, each once."""
    near = (probes[:, np.newaxis] + np.arange(-neighbours, neighbours + 1)).ravel()
    return np.unique(np.concatenate([frames, near[(near >= 0) & (near < n_frames)]]))


def _tables(steps: Array) -> QuantisationTables:
    whole = np.clip(np.round(steps), 1, 255).astype(int).tolist()
    return QuantisationTables(tuple(whole[:64]), tuple(whole[64:]), "tuned")


def _encoder(encoder: Encoder, tables: QuantisationTables) -> Encoder:
    return replace(encoder, tables=tables, library="pillow")


def _mean_bytes(
    pictures: Sequence[ImageArray], tables: QuantisationTables, encoder: Encoder
) -> float:
    # At c = 50 the tables are written as they are.
    own = _encoder(encoder, tables)
    return float(np.mean([len(encode_jpeg(picture, 50, own)) for picture in pictures]))


def _describe(drive: Traverse, technique: Technique) -> Descriptions:
    return Descriptions.stack(describe_traverse(drive, technique, threads=1), technique.layout)
