"""From a plan to its runs: which pictures, which keys, which tasks.

Everything here is decided by content: the hashes of the pictures, the technique with all its
parameters and its weights, what is done to the pictures, the truth. Where files lie, when and by
how many workers a study runs does not count.
"""

import hashlib
import itertools
import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

from retraverse._version import __version__
from retraverse.datasets import GroundTruth
from retraverse.datasets.known import Dataset
from retraverse.errors import DataMissingError, RetraverseError
from retraverse.images import Frame, Traverse
from retraverse.images.worsening import Worsening
from retraverse.studies.keeping.cache import content_key
from retraverse.studies.keeping.records import RunRecord, Status
from retraverse.studies.plans.plan import (
    CHUNK_FRAMES,
    MatcherChoice,
    PicturePair,
    StudyPlan,
    TechniqueChoice,
)
from retraverse.studies.tasks.describe_task import made_technique, one_line_reason
from retraverse.studies.tasks.match_task import RunSpec, needs_descriptions
from retraverse.techniques.sending import Coding, coding_label, sent_bytes
from retraverse.types import Progress, no_progress

__all__ = ["CODE", "Chunk", "Drive", "Job", "jobs", "read_drive"]

CODE = ("study 2", __version__)
"""Part of every key: results of other code are not ours. Raise the number if the meaning of an
entry or record changes between two versions of this package."""


@dataclass(frozen=True)
class Chunk:
    """Some consecutive frames of a drive."""

    label: str
    frames: tuple[Frame, ...]
    digests: tuple[bytes, ...]

    @cached_property
    def content(self) -> bytes:
        """Hash of its frames' contents, names not counted."""
        return hashlib.sha256(b"".join(self.digests)).digest()


@dataclass(frozen=True)
class Drive:
    """The frames of a drive with their hashes."""

    traverse: Traverse
    digests: tuple[bytes, ...]
    content_hash: str
    """As `Traverse.content_hash` makes it."""

    @cached_property
    def chunks(self) -> tuple[Chunk, ...]:
        """All frames, `CHUNK_FRAMES` at a time."""
        starts = range(0, len(self.traverse), CHUNK_FRAMES)
        return tuple(self._chunk(slice(start, start + CHUNK_FRAMES)) for start in starts)

    def _chunk(self, rows: slice) -> Chunk:
        frames = self.traverse.frames[rows]
        label = f"{self.traverse.name}, {frames[0].name} to {frames[-1].name}"
        return Chunk(label, frames, self.digests[rows])


def read_drive(traverse: Traverse, progress: Progress = no_progress) -> Drive:
    """Return the frames of a drive with the hashes of their contents; reads every file.

    Raises
    ------
    FrameReadError
        If a file cannot be read.
    """
    digests, whole = [], hashlib.sha256()
    for frame in progress(traverse.frames, total=len(traverse), label=f"hashing {traverse.name}"):
        digests.append(hashlib.sha256(frame.fingerprint()).digest())
        whole.update(hashlib.sha256(frame.name.encode()).digest())
        whole.update(digests[-1])
    return Drive(traverse, tuple(digests), whole.hexdigest())


@dataclass(frozen=True)
class Job:
    """One technique on one pair of drives: one matrix, all matchers, lengths and seeds."""

    dataset: Dataset
    query: Drive
    reference: Drive
    pair: PicturePair
    technique: TechniqueChoice
    identity: Mapping[str, Any]
    """Of the technique: what decides its descriptions."""
    runs: tuple[RunSpec, ...]
    study: str
    chapter: str
    with_entropy: bool
    """Whether the entropy of the query pictures goes into the records."""
    with_legibility: bool = False
    """Whether what can be read in query pictures goes into the records."""
    sent: Coding | None = None
    """How the query's descriptors are sent; None = pictures are."""
    error: tuple[Status, str] | None = None
    """Why it cannot be run at all."""
    _fingerprints: dict[tuple[Worsening, bytes], str] = field(default_factory=dict, repr=False)

    @cached_property
    def matrix_key(self) -> str:
        """Key of the similarity matrix."""
        sides = [
            self._pictures(worsening, bytes.fromhex(drive.content_hash))
            for drive, worsening in self.sides
        ]
        coded = () if self.sent is None else ("sent", self.sent.name, vars(self.sent))
        return content_key(CODE, "matrix", self.identity, *sides, *coded)

    @property
    def sides(self) -> tuple[tuple[Drive, Worsening], tuple[Drive, Worsening]]:
        """Query and reference, each with what is done to it."""
        return (self.query, self.pair.query), (self.reference, self.pair.reference)

    @cached_property
    def needs_descriptions(self) -> bool:
        """Whether the matrix alone will not do."""
        return needs_descriptions(self.technique, self.runs)

    @property
    def needs_entropy(self) -> bool:
        """Whether the entropy of the query pictures is needed beside the descriptions."""
        arrays = made_technique(self.technique).layout.arrays
        is_dynamic = any(spec.sequence_length == "dynamic" for spec in self.runs)
        return self.with_entropy or (is_dynamic and "entropy" not in arrays)

    def description_key(self, chunk: Chunk, worsening: Worsening) -> str:
        """Key of the descriptions of some frames."""
        pictures = self._pictures(worsening, chunk.content)
        return content_key(CODE, "descriptions", self.identity, pictures)

    def picture_key(self, chunk: Chunk, worsening: Worsening, entropy: bool) -> str:
        """Key of sizes, t_c and entropy of some frames."""
        return content_key(CODE, "pictures", self._pictures(worsening, chunk.content), entropy)

    @cached_property
    def legibility_key(self) -> str:
        """Key of what can be read in pictures like the query's."""
        return content_key(CODE, "legibility", self._pictures(self.pair.query, b""))

    def _pictures(self, worsening: Worsening, content: bytes) -> str:
        """Return what identifies pictures: what they were and what was done to them."""
        known = self._fingerprints.get((worsening, content))
        if known is None:
            known = worsening.fingerprint(content).hex()
            self._fingerprints[worsening, content] = known
        return known

    def base(self, provenance: str) -> RunRecord:
        """Return what its records have in common, before anything is measured."""
        layout = None if self.error else made_technique(self.technique).layout
        pair, truth = self.pair, None if self.error else self.dataset.truth()
        coded = shared = -1
        if layout is not None and self.sent is not None:
            coded = sent_bytes(layout, self.sent)
            shared = self.sent.n_shared_bytes(layout.descriptor)
        encoded = [side for side in (pair.query, pair.reference) if side.compression is not None]
        video = pair.query.video
        return RunRecord(
            run_id="",
            study=self.study,
            dataset=self.dataset.name,
            technique=self.technique.name,
            technique_parameters=_json(asdict(made_technique(self.technique).parameters)),
            chapter=self.chapter,
            compression_query=_or(pair.query.compression, -1),
            compression_reference=_or(pair.reference.compression, -1),
            encoder=encoded[0].encoder.label if encoded else "",
            jpeg_part=pair.query.part,
            video="" if video is None else video.codec,
            video_quality=-1 if video is None else video.quality,
            group_length=0 if video is None else video.length,
            resize=_or(pair.query.resize, 0),
            resizer=pair.query.resizer if pair.query.resize else "",
            tolerance_frames=-1 if truth is None else self.dataset.tolerance_frames,
            truth="" if truth is None else truth.description,
            n_queries=len(self.query.traverse),
            n_references=len(self.reference.traverse),
            descriptor_coding="" if self.sent is None else coding_label(self.sent),
            coded_bytes=coded,
            coding_shared_bytes=shared,
            descriptor_bytes=-1 if layout is None else layout.descriptor.n_bytes,
            descriptor_dimension=-1 if layout is None else layout.dimension,
            similarity_key=self.matrix_key,
            provenance=provenance,
        )

    def without(self, done: set[str]) -> "Job":
        """Return the job without the runs that are done."""
        return replace(self, runs=tuple(spec for spec in self.runs if spec.run_id not in done))


def jobs(plan: StudyPlan, dataset: Dataset, query: Drive, reference: Drive) -> Iterator[Job]:
    """Yield the jobs of one dataset, in the plan's order."""
    truth = _truth_key(dataset.truth())
    fingerprints: dict[tuple[Worsening, bytes], str] = {}
    for choice in plan.techniques:
        for pair, sent in itertools.product(plan.pairs, plan.sent_by(choice)):
            technique = choice.at(pair.query.resize)
            identity, error = _identity(technique)
            job = Job(
                dataset=dataset,
                query=query,
                reference=reference,
                pair=pair,
                technique=technique,
                identity=identity,
                runs=(),
                study=plan.name,
                chapter=plan.chapter,
                with_entropy=plan.entropy,
                with_legibility=plan.legibility,
                sent=sent,
                error=error,
                _fingerprints=fingerprints,
            )
            yield replace(job, runs=tuple(_runs(plan, job, truth)))


def _runs(plan: StudyPlan, job: Job, truth: str) -> Iterator[RunSpec]:
    common = [CODE, job.dataset.name, job.matrix_key, truth, job.with_entropy, job.with_legibility]
    common_key = content_key(common)
    for chosen, length in plan.settings(job.technique):
        label = _label(chosen.name, tuple(sorted(chosen.parameters.items())))
        for seed in plan.seeds:
            yield RunSpec(content_key(common_key, label, length, seed), chosen, length, seed)


@lru_cache(maxsize=256)
def _label(name: str, parameters: tuple[tuple[str, Any], ...]) -> str:
    return MatcherChoice(name, dict(parameters)).label


def _identity(choice: TechniqueChoice) -> tuple[dict[str, Any], tuple[Status, str] | None]:
    """Return what decides a technique's descriptions; without its weights, the reason too."""
    made = made_technique(choice)
    identity: dict[str, Any] = {
        "name": made.name,
        "version": made.version,
        "parameters": asdict(made.parameters),
    }
    weights = getattr(made, "fingerprint", None)
    try:
        if weights is not None:
            # Their content counts, not what they are called or where they lie.
            identity["weights"] = weights()
            for name in ("weights", "clean_weights"):
                identity["parameters"].pop(name, None)
    except DataMissingError as error:
        return identity, ("missing", one_line_reason(error))
    except (RetraverseError, OSError) as error:
        return identity, ("failed", one_line_reason(error))
    return identity, None


def _truth_key(truth: GroundTruth) -> str:
    pairs = [positives.tolist() for positives in truth.positives]
    return content_key(truth.description, pairs)


def _or(value: int | None, default: int) -> int:
    return default if value is None else value


def _json(value: Any) -> str:
    return json.dumps(value, sort_keys=True, default=str)
