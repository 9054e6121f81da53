"""Numbers of records in words, and what each of them means."""

import math
from collections.abc import Mapping

from retraverse.datasets.driven_again import recorded_name
from retraverse.datasets.known import known_dataset, known_datasets
from retraverse.metrics import DEFINITIONS
from retraverse.reports.wording import NARROW, NOTHING, count, percent, plain, ratio, seconds
from retraverse.studies.keeping.records import RunRecord

__all__ = [
    "MEANINGS",
    "codec_title",
    "compression_text",
    "damage_text",
    "dataset_order",
    "dataset_title",
    "length_words",
    "meanings",
    "measured_on",
    "number_columns",
    "place_text",
    "run_name",
    "sent_text",
    "size_text",
    "tolerance_text",
]

_CODECS: Mapping[str, str] = {"h265": "H.265", "av1": "AV1"}

MEANINGS: Mapping[str, str] = {
    "accuracy": DEFINITIONS["accuracy"],
    "interval": DEFINITIONS["accuracy_interval"],
    "AUC": DEFINITIONS["auc"],
    "P_R100": DEFINITIONS["p_r100"],
    "R_P100": DEFINITIONS["r_p100"],
    "EP": DEFINITIONS["ep"],
    "K": "Sequence length: query frames that are matched together. A dynamic K is chosen for each "
    "window; its mean is given.",
    "c": "JPEG compression in per cent: quality 100 − c. “as is” means the pictures' own files.",
    "change": "Accuracy minus that of clean pictures with the same dataset, technique and K, in "
    "percentage points.",
    "boost": "100 (a_K − a_1) / a_1: how much better than single frames; undefined where a_1 = 0.",
    "smallest K": "The first K at which every window is answered correctly, and the K from which "
    "on that stays so. Windows: query windows left at that K. Candidates: map windows each of them "
    "could take; few candidates make a right answer easy, one makes it certain.",
    "t_e": "Encoding time: describing one picture on one thread.",
    "t_m": "Matching time: one query window against the whole map, descriptors given.",
    "t_VPR": "t_e × K + t_m: what one answer costs when all pictures of its window are described.",
    "t_c": "Compression time: resizing and JPEG-encoding one query picture.",
    "t_total": "t_VPR + t_c × K: one answer, compressing its pictures included.",
    "d": "Data of one answer: mean bytes of a query picture × K; of its descriptor, where "
    "descriptors are sent.",
    "window bytes": "Mean bytes of a query picture, or of its descriptor where that is sent, × K: "
    "what a robot sends for one answer; the map's own are not counted.",
    "group bytes": "Mean bytes of what is sent for a query frame × K; a picture of a video weighs "
    "its group's bytes / the group's pictures.",
    "time of a frame": "t_e + t_m: describing a new picture and matching the window that ends with "
    "it, when the descriptors of the frames before are kept; and t_coding where they are sent.",
    "windows": "Query windows that were answered: Q − K + 1 for a fixed K.",
    "candidates": "Map windows that each of them could take: R − K + 1 for a fixed K.",
    "query picture": "Mean bytes of a query picture's file as it is sent and described.",
    "picture size": "Mean bytes of a picture file as it is sent and described, query and map "
    "together.",
    "dataset size": "Bytes of all picture files, query and map together.",
    "entropy": "Mean entropy of the query pictures' grey values, 0 (flat) to 1.",
    "PCU": "Precision per compute: P_R100 × log10(t_e of the slowest / t_e + 9); a sequence pays "
    "t_e K times.",
    "descriptor size": "Bytes of one picture's descriptor.",
    "description as sent": "Bytes of all that is compared of one query frame, its descriptor in "
    "the coding it was sent in.",
    "t_coding": "Writing and reading one frame's descriptor as it was sent; it is in t_VPR.",
    "known before": "Bytes that both ends must have before the first descriptor is sent so.",
    "without keypoints": "Share of the query pictures in which the technique found nothing to "
    "describe.",
    "without tables": "Mean bytes of a query picture without what all JPEG files of one encoder "
    "and c have in common: the receiver puts these tables back, and decodes the very same picture.",
    "legible height": "Smallest height of a number plate's characters that a reader who knows all "
    "but the character reads nine times in ten, in made-up scenes worsened like the pictures, as a "
    "share of the picture's side. Measured up to a quarter of the side.",
    "images": "Mean over the datasets, each weighted by its number of query pictures.",
}
"""Name of a number -> what it is."""


def meanings(*names: str) -> tuple[tuple[str, str], ...]:
    """Return (name, definition) pairs."""
    return tuple((name, MEANINGS[name]) for name in names)


def dataset_order(name: str) -> tuple[int, str]:
    """Return what datasets are sorted by: those known by name first, in their own order."""
    names = [known.name for known in known_datasets()]
    recorded = recorded_name(name)[0]
    return (names.index(recorded) if recorded in names else len(names), name)


def dataset_title(name: str) -> str:
    """Return a dataset's name as people write it."""
    recorded = recorded_name(name)[0]
    known = known_dataset(recorded)
    return name if known is None else known.title + name.removeprefix(recorded)


def tolerance_text(record: RunRecord) -> str:
    """Return how near an answer must be: "±2 frames", or the truth's own words."""
    if record.tolerance_frames < 0:
        return record.truth
    if record.tolerance_frames == 0:
        return "to the frame"
    return f"±{count(record.tolerance_frames, 'frame')}"


def measured_on(record: RunRecord) -> str:
    """Return "500 queries, ±2 frames"."""
    queries = count(record.n_queries, "query", "queries")
    return ", ".join(part for part in (queries, tolerance_text(record)) if part)


def compression_text(compression: int) -> str:
    """Return one c: "50", or "as is"."""
    return "as is" if compression < 0 else str(compression)


def damage_text(record: RunRecord) -> str:
    """Return what was done beside whole JPEG files: "H.265 crf 36, groups of 8", "means alone"."""
    if record.video:
        return f"{codec_title(record.video)} crf {record.video_quality}, {_groups(record)}"
    return f"{record.jpeg_part} alone" if record.jpeg_part else ""


def sent_text(record: RunRecord) -> str:
    """Return how a query frame was sent: "c = 95", "crf 36", "36 a frame"."""
    if record.descriptor_coding:
        return f"{record.coded_bytes:,} a frame"
    if record.video:
        return f"crf {record.video_quality}"
    return f"c = {compression_text(record.compression_query)}"


def codec_title(codec: str) -> str:
    """Return a video codec's name as people write it."""
    return _CODECS.get(codec, codec)


def _groups(record: RunRecord) -> str:
    return f"groups of {record.group_length}"


def place_text(record: RunRecord) -> str:
    """Return what was done to the pictures: "c = 50, 256 px"."""
    query, reference = record.compression_query, record.compression_reference
    damage, parts = damage_text(record), []
    if record.video:
        parts.append(f"query as {damage}, map {'as is' if reference < 0 else f'c = {reference}'}")
    elif query == reference and query >= 0:
        parts.append(f"c = {query}")
    elif query != reference:
        parts.append(f"c = {compression_text(query)} query, {compression_text(reference)} map")
    if record.jpeg_part:
        parts.append(damage)
    if record.resize:
        parts.append(f"{record.resize} px")
    if record.descriptor_coding:
        parts.append(f"sent as {record.descriptor_coding}")
    return ", ".join(parts) or "pictures as they are"


def length_words(record: RunRecord) -> str:
    """Return "K = 10", or "dynamic K, mean 6.5"."""
    if record.sequence_length.isdigit():
        return f"K = {record.sequence_length}"
    return f"{record.sequence_length} K, mean {plain(record.mean_sequence_length)}"


def run_name(record: RunRecord) -> str:
    """Return what was run on what: "hog, dtw on Corridor"."""
    matcher = "" if record.matcher == "mean" else f", {record.matcher}"
    return f"{record.technique}{matcher} on {dataset_title(record.dataset)}"


def size_text(n_bytes: float) -> str:
    """Return bytes in decimal units, three figures: 12345 -> "12.3 kB"."""
    if not math.isfinite(n_bytes) or n_bytes < 0:
        return NOTHING
    for factor, unit in ((1e9, "GB"), (1e6, "MB"), (1e3, "kB")):
        if n_bytes >= factor:
            scaled = n_bytes / factor
            return f"{scaled:,.{max(0, 2 - int(math.log10(scaled)))}f}{NARROW}{unit}"
    return f"{n_bytes:.0f}{NARROW}bytes"


def number_columns(record: RunRecord, data: float) -> list[tuple[str, str]]:
    """Return every number of a run with its name, for the run's own view."""
    return [
        ("accuracy", percent(record.accuracy)),
        ("interval", f"{percent(record.accuracy_low)} to {percent(record.accuracy_high)}"),
        ("AUC", ratio(record.auc)),
        ("P_R100", percent(record.p_r100)),
        ("R_P100", percent(record.r_p100)),
        ("EP", ratio(record.ep)),
        ("windows", f"{record.n_windows:,}"),
        ("candidates", f"{record.n_candidates:,}"),
        ("query picture", size_text(record.query_bytes_mean)),
        ("without tables", size_text(record.query_bare_bytes_mean)),
        ("d", size_text(data)),
        ("legible height", percent(record.legible_height)),
        ("descriptor size", size_text(record.descriptor_bytes)),
        ("description as sent", size_text(record.coded_bytes)),
        ("known before", size_text(record.coding_shared_bytes)),
        ("t_e", seconds(record.encode_s)),
        ("t_m", seconds(record.match_s)),
        ("t_VPR", seconds(record.vpr_s)),
        ("t_c", seconds(record.compress_s)),
        ("t_coding", seconds(record.coding_s)),
    ]
