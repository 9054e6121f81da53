"""Reading pictures: a folder, a pattern, a video, a list of files or arrays becomes a `Traverse`.

Names
-----
- `open_traverse`: the one door; says what it takes.
- `Traverse`, `Frame`: the frames of a drive in order; one picture, decoded when asked.
- `SkippedFrame`: a frame left out on request, and why.
- `GreyPath`, `ColourOrder`: the two ways to grey; the channel order of a user's arrays.
- `decode_grey`, `decode_bgr`: the same decoding for bytes that came from elsewhere.
- `without_stops`, `measure_motion`: a drive without the frames on which nothing moved.
- `worsened`, `worsen_frame`, `worsen_each`, `Worsening`: pictures resized and compressed.
- `worsen_group`, `VideoGroups`: pictures sent together by a video codec.
- `Encoder`, `encode_jpeg`, `QuantisationTables`: JPEG and its options.
- `jpeg_traces`: how much JPEG took out of a picture, seen in its pixels.
- `natural_key`, `PICTURE_SUFFIXES`: how folders are listed.

Importing this package loads neither OpenCV nor Pillow.
"""

from retraverse.images.decode import ColourOrder, GreyPath, decode_bgr, decode_grey
from retraverse.images.files import PICTURE_SUFFIXES
from retraverse.images.frame import Frame
from retraverse.images.jpeg import Encoder, encode_jpeg
from retraverse.images.jpeg_traces import STRONG_TRACES, jpeg_traces
from retraverse.images.ordering import natural_key
from retraverse.images.picture_cache import PictureCache
from retraverse.images.quantisation import QuantisationTables
from retraverse.images.sources import Source, open_traverse
from retraverse.images.stops import MIN_MOTION, measure_motion, without_stops
from retraverse.images.traverse import SkippedFrame, Traverse
from retraverse.images.worsen import (
    WorsenedFrame,
    frame_bytes,
    worsen_each,
    worsen_frame,
    worsen_group,
    worsened,
)
from retraverse.images.worsening import VideoGroups, Worsening

__all__ = [
    "MIN_MOTION",
    "PICTURE_SUFFIXES",
    "STRONG_TRACES",
    "ColourOrder",
    "Encoder",
    "Frame",
    "GreyPath",
    "PictureCache",
    "QuantisationTables",
    "SkippedFrame",
    "Source",
    "Traverse",
    "VideoGroups",
    "WorsenedFrame",
    "Worsening",
    "decode_bgr",
    "decode_grey",
    "encode_jpeg",
    "frame_bytes",
    "jpeg_traces",
    "measure_motion",
    "natural_key",
    "open_traverse",
    "without_stops",
    "worsen_each",
    "worsen_frame",
    "worsen_group",
    "worsened",
]
