"""Figure 3.2: the regions of interest of query pictures, for several entropy thresholds.

Drawn where the pictures are at hand, with the technique's own descriptions: what a region must
have to be matched is `roi_entropy`, the thesis' ET.
"""

import json
from collections.abc import Sequence
from dataclasses import fields

import numpy as np

from retraverse.errors import RetraverseError
from retraverse.images import Frame
from retraverse.reports.study_report.artefacts import Gallery, GalleryPicture, GalleryRow
from retraverse.reports.study_report.chapters.context import ChapterInput
from retraverse.reports.study_report.picture_files import PictureFiles
from retraverse.reports.study_report.words import dataset_order, dataset_title
from retraverse.studies.keeping.records import RunRecord
from retraverse.techniques.convsequential import ConvSequential, ConvSequentialParameters
from retraverse.types import BoolArray, FloatArray, ImageArray

__all__ = ["THRESHOLDS", "region_galleries", "shaded"]

THRESHOLDS = (0.4, 0.5, 0.6, 0.7, 0.75)
"""The ET shown, of those between 0.4 and 0.75 in the thesis."""
_PICTURES = 3
"""Query pictures of each dataset."""
_DIMMED = 0.22
"""Brightness left where no region of interest lies."""


def region_galleries(given: ChapterInput) -> tuple[Gallery, ...]:
    """Return one gallery for every dataset that ConvSequential-SLAM ran on, if it has pictures."""
    pictures = given.pictures
    if pictures is None:
        return ()
    runs = {
        run.dataset: run
        for run in given.records
        if run.technique == "convsequential" and run.status == "ok"
    }
    ordered = sorted(runs.values(), key=lambda run: dataset_order(run.dataset))
    galleries = [_gallery(run, pictures) for run in ordered]
    return tuple(gallery for gallery in galleries if gallery.rows)


def _gallery(run: RunRecord, pictures: PictureFiles) -> Gallery:
    technique = _technique(run)
    middles = (np.arange(_PICTURES) + 0.5) * run.n_queries / _PICTURES
    rows = [_row(run, technique, int(at), pictures) for at in middles]
    used = technique.parameters.roi_entropy
    return Gallery(
        "Figure 3.2",
        f"{dataset_title(run.dataset)}: regions of interest by entropy threshold",
        tuple(row for row in rows if row is not None),
        "Bright: covered by regions whose entropy is at least ET; only they are matched. A higher "
        f"ET leaves out walls, floors and sky. The runs of this page have ET = {used:g}. A picture "
        "without any region is matched by all of them.",
        (
            ("ET", "Entropy threshold: a region of 2 x 2 cells of 16 px is matched if the mean "
             "local entropy in it, over 8 bits, is at least this; 0 to 0.7925."),
        ),
    )  # fmt: skip


def _technique(run: RunRecord) -> ConvSequential:
    """Return the technique with the parameters of a run."""
    known = {field.name for field in fields(ConvSequentialParameters)}
    given = json.loads(run.technique_parameters)
    values = {name: value for name, value in given.items() if name in known}
    return ConvSequential(ConvSequentialParameters(**values))


def _row(
    run: RunRecord, technique: ConvSequential, at: int, pictures: PictureFiles
) -> GalleryRow | None:
    frame = pictures.frame(run, "query", at)
    if frame is None:
        return None
    try:
        entropy = technique.describe(technique.read(frame))["region_entropy"]
        whole = frame.colour()
    except (RetraverseError, OSError):
        return None
    plain = GalleryPicture(pictures.address(run, "query", at), f"Query frame {at}", "as it is")
    shown = [_overlay(run, frame, whole, entropy, et, pictures) for et in THRESHOLDS]
    return GalleryRow(f"Query frame {at}", (plain, *shown))


def _overlay(
    run: RunRecord,
    frame: Frame,
    whole: ImageArray,
    entropy: FloatArray,
    threshold: float,
    pictures: PictureFiles,
) -> GalleryPicture:
    chosen = np.asarray(entropy >= np.float32(threshold))
    counted = f"{int(chosen.sum()):,} of {chosen.size:,} regions"
    return GalleryPicture(
        pictures.drawn(run, f"q{frame.index}-et{threshold:g}", shaded(whole, chosen)),
        f"Query frame {frame.index} with its regions of interest at ET = {threshold:g}: {counted}",
        f"ET = {threshold:g}: {counted}",
    )


def shaded(picture: ImageArray, chosen: Sequence[bool] | BoolArray) -> ImageArray:
    """Return a picture that is dark wherever no chosen region lies.

    Parameters
    ----------
    picture : uint8 array, shape (H, W, 3)
    chosen : bool array, shape (n * n,)
        Regions row by row; each covers 2 x 2 of the picture's (n + 1) x (n + 1) cells.
    """
    n = round(len(chosen) ** 0.5)
    grid = np.asarray(chosen, bool).reshape(n, n)
    cells = np.zeros((n + 1, n + 1), bool)
    for down in (0, 1):
        for right in (0, 1):
            cells[down : down + n, right : right + n] |= grid
    height, width = picture.shape[:2]
    rows = np.arange(height) * (n + 1) // height
    columns = np.arange(width) * (n + 1) // width
    light = np.where(cells[np.ix_(rows, columns)], 1.0, _DIMMED)
    return np.asarray(picture * light[..., np.newaxis], np.uint8)
