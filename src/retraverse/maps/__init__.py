"""Maps: a reference traverse described once, kept in crash-safe files, grown and read again."""

from retraverse.maps.build import build_map, load_map
from retraverse.maps.describe import DescribedFrame, Frames, describe_frames, describe_traverse
from retraverse.maps.frame_table import FrameRecord, FrameTable
from retraverse.maps.provenance import Provenance, Step, TechniqueRecord
from retraverse.maps.route_map import RouteMap

__all__ = [
    "DescribedFrame",
    "FrameRecord",
    "FrameTable",
    "Frames",
    "Provenance",
    "RouteMap",
    "Step",
    "TechniqueRecord",
    "build_map",
    "describe_frames",
    "describe_traverse",
    "load_map",
]
