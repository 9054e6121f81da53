"""Studies: runs whose results are records. So far one: a comparison of two drives."""

from retraverse.studies.comparison import ComparePlan, compare
from retraverse.studies.comparison_record import (
    ComparisonRecord,
    LengthPoint,
    Provenance,
    Times,
    TraverseRecord,
)

__all__ = [
    "ComparePlan",
    "ComparisonRecord",
    "LengthPoint",
    "Provenance",
    "Times",
    "TraverseRecord",
    "compare",
]
