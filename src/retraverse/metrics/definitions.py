"""One sentence for every number of an `Evaluation`: reports print these beside the numbers."""

from collections.abc import Mapping

__all__ = ["DEFINITIONS"]

_THESIS = (
    "the precision-recall curve over best matches, every distinct score a threshold, "
    "recall's denominator being the number of correct best matches"
)
_SINGLE = (
    "the precision-recall curve over best matches, every distinct score a threshold, "
    "recall's denominator being all queries that have a true match"
)

DEFINITIONS: Mapping[str, str] = {
    "accuracy": (
        "Windows answered correctly / windows answered; an answer is judged by the first frame of "
        'its window, and "no match" is correct where the query truly has none.'
    ),
    "accuracy_all_queries": "Windows answered correctly / all queries, the unanswered being wrong.",
    "accuracy_interval": (
        "Percentile bootstrap interval of the accuracy, windows drawn one by one with replacement; "
        "neighbouring windows fail together, so another drive may well fall outside."
    ),
    "auc": f"Area by trapezoids, from recall 0 and precision 1, under {_THESIS} (definition "
    '"thesis").',
    "auc_single": f"Area by trapezoids, from recall 0 and precision 1, under {_SINGLE} (definition "
    '"single").',
    "auc_multi": (
        "Area by trapezoids, from recall 0 and precision 1, under the precision-recall curve over "
        "all cells of the single-frame similarity matrix, every distinct score a threshold, "
        'recall\'s denominator being all true cells (definition "multi").'
    ),
    "average_precision": f"Sum of precision times the step in recall along {_THESIS}.",
    "p_r100": f"Largest precision at recall 1 on {_THESIS}.",
    "r_p100": f"Largest recall at precision 1 on {_THESIS}.",
    "r_p100_single": f"Largest recall at precision 1 on {_SINGLE}.",
    "ep": (
        "Extended precision (P_R0 + R_P100) / 2: P_R0 is the precision of the highest score, "
        f"R_P100 counts as 0 where P_R0 is below 1; on {_THESIS}."
    ),
    "recall_at": (
        "Recall@N: queries with a true match among their N most similar references / all queries; "
        "single frames, of equal scores the earlier reference first."
    ),
    "recall_at_with_match": (
        "Recall@N: queries with a true match among their N most similar references / queries that "
        "have a true match; single frames, of equal scores the earlier reference first."
    ),
    "n_queries": "Frames of the query traverse.",
    "n_references": "Frames of the reference traverse, that is of the map.",
    "n_answered": 'Windows that got an answer, "no match" included.',
    "n_unanswered": "Queries that begin no window and so got no answer (the tail of the traverse).",
    "n_refused": 'Windows answered "no match".',
    "n_correct": "Windows answered correctly.",
    "n_with_match": "Queries that have a true match in the map.",
    "mean_sequence_length": "Mean number of frames K in the windows.",
    "truth": "Which pairs of frames count as the same place.",
}
"""Name of a field of `Evaluation` -> what it is."""
