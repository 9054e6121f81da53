"""How good an answer is: pure functions over arrays, no files.

Rows are queries, columns references, higher scores are better. `evaluate` gives all numbers of a
run; the functions it is made of stand beside it.
"""

from retraverse.metrics.bootstrap import Interval, bootstrap_interval
from retraverse.metrics.definitions import DEFINITIONS
from retraverse.metrics.efficiency import (
    data_volume,
    performance_per_compute_unit,
    t_total,
    t_vpr,
)
from retraverse.metrics.evaluation import Evaluation, evaluate
from retraverse.metrics.precision_recall import (
    PrecisionRecall,
    area_under_curve,
    average_precision,
    cell_precision_recall_curve,
    extended_precision,
    precision_at_full_recall,
    precision_recall_curve,
    recall_at_full_precision,
)
from retraverse.metrics.recall import RecallAt, recall_at, true_match_rank

__all__ = [
    "DEFINITIONS",
    "Evaluation",
    "Interval",
    "PrecisionRecall",
    "RecallAt",
    "area_under_curve",
    "average_precision",
    "bootstrap_interval",
    "cell_precision_recall_curve",
    "data_volume",
    "evaluate",
    "extended_precision",
    "performance_per_compute_unit",
    "precision_at_full_recall",
    "precision_recall_curve",
    "recall_at",
    "recall_at_full_precision",
    "t_total",
    "t_vpr",
    "true_match_rank",
]
