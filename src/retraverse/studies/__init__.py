"""Studies: runs whose results are records.

One comparison of two drives (`compare`), or a grid of runs from a plan (`load_plan`, `run_study`),
kept as one row a run (`RunRecord`).
"""

from retraverse.studies.comparison import ComparePlan, compare
from retraverse.studies.comparison_record import (
    ComparisonRecord,
    LengthPoint,
    Provenance,
    Times,
    TraverseRecord,
)
from retraverse.studies.engine import StudyResult, run_study
from retraverse.studies.keeping.records import RunRecord, read_records, write_records
from retraverse.studies.keeping.study_folder import read_study
from retraverse.studies.plans.plan import MatcherChoice, PicturePair, StudyPlan, TechniqueChoice
from retraverse.studies.plans.plan_checks import PlanError
from retraverse.studies.plans.plan_file import load_plan

__all__ = [
    "ComparePlan",
    "ComparisonRecord",
    "LengthPoint",
    "MatcherChoice",
    "PicturePair",
    "PlanError",
    "Provenance",
    "RunRecord",
    "StudyPlan",
    "StudyResult",
    "TechniqueChoice",
    "Times",
    "TraverseRecord",
    "compare",
    "load_plan",
    "read_records",
    "read_study",
    "run_study",
    "write_records",
]
