"""Study records made up for the report's tests: plausible numbers, answers and matrices."""

import hashlib
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from retraverse.datasets import GroundTruth, aligned
from retraverse.images import Frame, Traverse
from retraverse.studies.keeping.cache import StudyCache
from retraverse.studies.keeping.records import RunRecord, write_records

ROUTES = {"corridor": 60, "campus_loop": 100}
"""Made-up numbers of frames; Campus Loop has the thesis' own, so its values are printed."""
TECHNIQUES = {"hog": 0.42, "cohog": 0.6}
"""Made-up accuracies of single frames."""
COMPRESSIONS = (0, 90, 99)
ENCODE_S = {"hog": 0.004, "cohog": 0.02, "gist": 0.09, "orb": 0.003, "convsequential": 0.006}


def make_run(
    dataset: str = "corridor",
    technique: str = "hog",
    length: str = "1",
    *,
    chapter: str = "",
    accuracy: float | None = None,
    compression: tuple[int, int] = (-1, -1),
    resize: int = 0,
    matrix: str = "",
    answers: bool = True,
    **others: Any,
) -> RunRecord:
    """Return one run whose answers agree with its accuracy."""
    n = ROUTES.get(dataset, 40)
    k = int(length) if length.isdigit() else 4
    n_windows = n - k + 1
    single = TECHNIQUES.get(technique, 0.5) - 0.2 * max(*compression, 0) / 100
    share = min(1.0, single + 0.06 * (k - 1)) if accuracy is None else accuracy
    wrong = round((1 - share) * n_windows)
    rng = np.random.default_rng(list(f"{dataset}{technique}{length}{compression}{resize}".encode()))
    bad = set(rng.permutation(n_windows)[:wrong].tolist())
    size = 12_000 * (1 - max(compression[0], 0) / 102) * ((resize or 256) / 256) ** 2 + 300
    values: dict[str, Any] = {
        "study": "made up",
        "technique_parameters": json.dumps({"cell_size": 16}),
        "chapter": chapter,
        "mean_sequence_length": float(k),
        "compression_query": compression[0],
        "compression_reference": compression[1],
        "encoder": "pillow 4:2:0" if max(compression) >= 0 else "",
        "resize": resize,
        "resizer": "pillow bicubic" if resize else "",
        "tolerance_frames": 2,
        "truth": "aligned, within 2 frames",
        "n_queries": n,
        "n_references": n,
        "n_windows": n_windows,
        "n_candidates": n_windows,
        "accuracy": 1 - wrong / n_windows,
        "accuracy_low": max(0.0, 1 - wrong / n_windows - 0.05),
        "accuracy_high": min(1.0, 1 - wrong / n_windows + 0.05),
        "auc": min(1.0, share + 0.1),
        "p_r100": share,
        "r_p100": share / 2,
        "ep": 0.5 + share / 4,
        "query_bytes_mean": size,
        "reference_bytes_mean": size,
        "query_bytes_total": round(size * n),
        "reference_bytes_total": round(size * n),
        "entropy_query_mean": 0.8 - 0.002 * max(compression[0], 0),
        "descriptor_bytes": 31_600,
        "descriptor_dimension": 7900,
        "no_descriptor_share": float(0 < resize < 64),
        "encode_s": ENCODE_S.get(technique, 0.01) * ((resize or 256) / 256) ** 2,
        "match_s": 0.001 * k,
        "vpr_s": ENCODE_S.get(technique, 0.01) * ((resize or 256) / 256) ** 2 * k + 0.001 * k,
        "compress_s": 0.0012,
        "sequence_lengths": tuple(2 + at % 5 for at in range(n_windows)) if k == 4 else (),
        "answer_query": tuple(range(n_windows)) if answers else (),
        "answer_reference": tuple((at + 20) % n if at in bad else at for at in range(n_windows)),
        "answer_score": tuple(
            round(0.5 + 0.4 * (at not in bad) * at / n, 4) for at in range(n_windows)
        ),
        "answer_correct": tuple(at not in bad for at in range(n_windows)),
        "similarity_key": matrix,
        "provenance": json.dumps({"version": "0.1", "machine": "test", "query_hash": "ab" * 8}),
        **others,
    }
    identity = f"{dataset}-{technique}-{length}-{compression}-{resize}-{others}"
    run_id = hashlib.sha256(identity.encode()).hexdigest()
    return RunRecord(
        run_id=run_id, dataset=dataset, technique=technique, sequence_length=length, **values
    )


def chapter_runs(chapter: str, *, matrix: str = "") -> list[RunRecord]:
    """Return the runs of one chapter on the made-up routes."""
    return list(_runs(chapter, matrix))


def _runs(chapter: str, matrix: str) -> Iterable[RunRecord]:
    lengths: Sequence[str] = [str(k) for k in (1, 2, 5, 10, 16)]
    for dataset in ROUTES:
        key = matrix if dataset == "corridor" else ""
        if chapter == "3":
            for technique in TECHNIQUES:
                yield make_run(dataset, technique, chapter=chapter, matrix=key)
            for length in (*lengths, "dynamic"):
                yield make_run(dataset, "convsequential", length, chapter=chapter, matrix=key)
        for technique in TECHNIQUES:
            if chapter in ("4", ""):
                for length in lengths:
                    yield make_run(dataset, technique, length, chapter=chapter, matrix=key)
            for c in COMPRESSIONS if chapter in ("5", "6") else ():
                ks = ["1"] if chapter == "5" else lengths
                for pair in {(c, c), (0, c), (c, 0)}:
                    for length in ks:
                        yield make_run(
                            dataset,
                            technique,
                            length,
                            chapter=chapter,
                            compression=pair,
                            resize=256 if chapter == "6" else 0,
                            matrix=key,
                        )
        for technique in (*TECHNIQUES, "orb") if chapter == "7" else ():
            for size in (16, 64, 256):
                yield make_run(dataset, technique, chapter=chapter, resize=size, matrix=key)


def write_study(folder: Path, records: Sequence[RunRecord], *, part: str = "part-0") -> Path:
    """Write a study's folder: records, and the matrix "ab..." of the corridor."""
    (folder / "records").mkdir(parents=True, exist_ok=True)
    write_records(folder / "records" / f"{part}.parquet", records)
    n = ROUTES["corridor"]
    rng = np.random.default_rng(1)
    matrix = rng.uniform(0, 0.6, (n, n)).astype(np.float32) + 0.4 * np.eye(n, dtype=np.float32)
    StudyCache(folder / "cache").save(MATRIX, {"similarity": matrix})
    return folder


MATRIX = "ab" * 32


class MadeUpDrives:
    """Two drives of noise with a bar that moves: the pictures of a made-up route."""

    def __init__(self, n_frames: int) -> None:
        self.n_frames = n_frames

    def query(self) -> Traverse:
        return self._drive("query", 0)

    def reference(self) -> Traverse:
        return self._drive("reference", 90)

    def truth(self) -> GroundTruth:
        return aligned(self.n_frames, self.n_frames, 2)

    def _drive(self, name: str, shade: int) -> Traverse:
        frames = []
        for at in range(self.n_frames):
            picture = np.full((48, 64, 3), 60 + shade, np.uint8)
            picture[:, at % 60 : at % 60 + 4] = (250, 200 - shade, 40)
            frames.append(Frame.from_array(picture, name=f"{name}_{at}.png", index=at))
        return Traverse(name, name, tuple(frames))
