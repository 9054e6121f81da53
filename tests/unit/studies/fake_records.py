"""Made-up records: plausible numbers for every field, no run behind them."""

import hashlib
import json
from dataclasses import replace
from typing import Any

import numpy as np

from retraverse.studies.keeping.records import RunRecord


def make_run(
    *,
    sequence_length: int = 1,
    n_queries: int = 30,
    n_references: int = 30,
    accuracy: float = 0.8,
    seed: int = 1,
    **changes: Any,
) -> RunRecord:
    """Return a record of `n_queries - K + 1` windows, about `accuracy` of them correct."""
    rng = np.random.default_rng(seed)
    n_windows = n_queries - sequence_length + 1
    correct = rng.random(n_windows) < accuracy
    share = float(correct.mean())
    query = np.arange(n_windows)
    reference = np.where(correct, query, (query + 7) % n_references)
    fields = {
        "technique": "hog",
        "dataset": "corridor",
        "compression_query": -1,
        "compression_reference": -1,
        **changes,
    }
    record = RunRecord(
        run_id=hashlib.sha256(repr((sequence_length, seed, fields)).encode()).hexdigest(),
        study="made-up",
        dataset="corridor",
        technique="hog",
        technique_parameters=json.dumps({"form": "vprbench", "resolution": 0}),
        sequence_length=str(sequence_length),
        mean_sequence_length=float(sequence_length),
        tolerance_frames=2,
        truth="same frame number, ±2",
        n_queries=n_queries,
        n_references=n_references,
        n_windows=n_windows,
        n_candidates=n_references - sequence_length + 1,
        accuracy=share,
        accuracy_low=max(0.0, share - 0.1),
        accuracy_high=min(1.0, share + 0.1),
        auc=min(1.0, share + 0.05),
        p_r100=share,
        r_p100=share / 2,
        ep=0.5 + share / 4,
        query_bytes_mean=5000.0,
        reference_bytes_mean=5000.0,
        query_bytes_total=5000 * n_queries,
        reference_bytes_total=5000 * n_references,
        entropy_query_mean=0.6,
        descriptor_bytes=142884,
        descriptor_dimension=35721,
        no_descriptor_share=0.0,
        encode_s=0.003,
        match_s=0.0001 * sequence_length,
        vpr_s=0.003 * sequence_length + 0.0001 * sequence_length,
        compress_s=0.001,
        answer_query=tuple(query.tolist()),
        answer_reference=tuple(reference.tolist()),
        answer_score=tuple(np.round(0.5 + rng.random(n_windows) / 2, 6).tolist()),
        answer_correct=tuple(correct.tolist()),
        provenance=json.dumps(
            {
                "version": "0.1.0",
                "query_sha256": "0" * 64,
                "reference_sha256": "1" * 64,
                "machine": "a machine",
                "created": "2026-01-01T00:00:00+00:00",
            }
        ),
    )
    return replace(record, **changes)
