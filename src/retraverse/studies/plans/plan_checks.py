"""What can be wrong between the parts of a plan, each of them sound."""

import itertools
from collections.abc import Iterable
from contextlib import suppress

from retraverse.datasets.known import Dataset
from retraverse.errors import InputError, RetraverseError
from retraverse.studies.plans.plan import CHUNK_FRAMES, PicturePair, StudyPlan
from retraverse.techniques.sending import CODINGS, Coding, coding_label

__all__ = ["PlanError", "plan_problems"]


class PlanError(InputError):
    """A plan cannot be run; `problems` has one line for each thing wrong with it."""

    def __init__(self, source: str, problems: list[str]) -> None:
        self.problems = tuple(problems)
        count = "1 problem" if len(problems) == 1 else f"{len(problems)} problems"
        super().__init__("\n  ".join([f"plan {source}: {count}", *problems]))


def plan_problems(plan: StudyPlan) -> list[str]:
    """Return what is wrong between the parts of a plan: lengths, sizes, matchers; one line each."""
    problems = [
        *_technique_problems(plan),
        *_dynamic_problems(plan),
        *_coding_problems(plan),
        *_picture_problems(plan),
        *(problem for dataset in plan.datasets for problem in _dataset_problems(plan, dataset)),
    ]
    return list(dict.fromkeys(problems))


def _technique_problems(plan: StudyPlan) -> list[str]:
    """Return the parameters that are out of range at one of the pictures' sizes."""
    problems = []
    sizes = dict.fromkeys(pair.query.resize for pair in plan.pairs or (PicturePair(),))
    for choice, size in itertools.product(plan.techniques, sizes):
        try:
            choice.at(size).make()
        except (RetraverseError, TypeError) as error:
            problems.append(f"technique {choice.name}: {error}")
    return problems


def _dynamic_problems(plan: StudyPlan) -> list[str]:
    return [
        f"matcher {chosen.name}: got the length 'dynamic', which only the matcher mean offers; "
        "give it sequence_lengths of its own"
        for technique in plan.techniques
        for chosen, length in plan.settings(technique)
        if length == "dynamic" and chosen.name != "mean"
    ]


def _coding_problems(plan: StudyPlan) -> list[str]:
    """Return the techniques whose descriptors cannot be sent as the plan says."""
    problems = []
    size = next((pair.query.resize for pair in plan.pairs), None)
    for choice in plan.techniques:
        sent = plan.sent_by(choice)
        strange = [one for one in sent if one is not None and type(one) not in CODINGS.values()]
        if strange:
            problems.append(
                f"technique {choice.name}: sent: got {strange[0]!r}, expected what "
                "retraverse.techniques.sending.coding returns, or None for pictures"
            )
            continue
        if len(set(sent)) < max(1, len(sent)):
            problems.append(f"technique {choice.name}: sent: got {_labels(sent) or 'nothing'}, "
                            "expected at least one, each once")  # fmt: skip
        with suppress(RetraverseError, TypeError):  # Said of the technique already.
            dtype = choice.at(size).make().layout.descriptor.dtype
            wrong = [one for one in sent if one and one.is_for_floats and dtype != "float32"]
            if wrong:
                problems.append(
                    f"technique {choice.name}: got descriptors of {dtype} to be sent as "
                    f"{_labels(wrong)}, which code float32 ones; give it sent of its own: "
                    "pictures, or exact"
                )
    return problems


def _labels(sent: Iterable[Coding | None]) -> str:
    return ", ".join("pictures" if one is None else coding_label(one) for one in sent)


def _picture_problems(plan: StudyPlan) -> list[str]:
    problems = []
    for pair in plan.pairs:
        if pair.query.video is not None and CHUNK_FRAMES % pair.query.video.length:
            problems.append(
                f"video.group: got {pair.query.video.length}, expected 1, 2, 4, 8, 16 or "
                f"{CHUNK_FRAMES}: {CHUNK_FRAMES} frames are described as one task"
            )
        if plan.legibility and pair.query.resize is None:
            problems.append(
                "legibility: got pictures that are not resized; expected images.resize, as the "
                "scenes to be read have a size of their own"
            )
    return problems


def _dataset_problems(plan: StudyPlan, dataset: Dataset) -> list[str]:
    """Return why a dataset cannot be run: no pictures, wrong truth, windows longer than it."""
    try:
        shortest = min(len(dataset.query()), len(dataset.reference()))
        dataset.truth()
    except InputError as error:
        return [f"dataset {dataset.name}: {error}"]
    lengths = [
        length
        for technique in plan.techniques
        for _, length in plan.settings(technique)
        if length != "dynamic"
    ]
    if max(lengths, default=0) > shortest:
        return [
            f"sequence_lengths: got {max(lengths)}, but dataset {dataset.name} has only {shortest} "
            "frames in a drive"
        ]
    return []
