"""One task of a map: some frames of a drive, described as a map keeps them."""

from dataclasses import asdict, dataclass

from retraverse.errors import InputError, RetraverseError
from retraverse.images import Frame
from retraverse.maps.describe import DescribedFrame, describe_frames
from retraverse.maps.thumbnails import ThumbnailSpec
from retraverse.studies.plans.plan import TechniqueChoice
from retraverse.studies.tasks.describe_task import made_technique, one_line_reason
from retraverse.techniques import Technique

__all__ = ["DescribedFrames", "FramesTask", "choice_of", "frames_task"]


@dataclass(frozen=True)
class FramesTask:
    """Consecutive frames and how they are described."""

    frames: tuple[Frame, ...]
    technique: TechniqueChoice
    thumbnails: ThumbnailSpec | None

    @property
    def label(self) -> str:
        """For messages."""
        return f"{self.frames[0].name} to {self.frames[-1].name}"


@dataclass(frozen=True)
class DescribedFrames:
    """What a task made, or why it made nothing."""

    frames: tuple[DescribedFrame, ...] = ()
    error: RetraverseError | None = None


def frames_task(task: FramesTask) -> DescribedFrames:
    """Return the described frames of a task; what goes wrong is returned, not raised."""
    try:
        technique = made_technique(task.technique)
        described = describe_frames(task.frames, technique, thumbnails=task.thumbnails, threads=1)
        return DescribedFrames(tuple(described))
    except RetraverseError as error:
        return DescribedFrames(error=error)
    except Exception as error:
        return DescribedFrames(error=RetraverseError(f"{task.label}: {one_line_reason(error)}"))


def choice_of(technique: Technique) -> TechniqueChoice:
    """Return a technique by name and parameters, as it can be sent to another process.

    Raises
    ------
    InputError
        If nobody else could make it again: it is not in the registry.
    """
    choice = TechniqueChoice(technique.name, asdict(technique.parameters))
    try:
        choice.make()
    except (RetraverseError, TypeError) as error:
        raise InputError(
            f"{technique.name}: workers cannot make it ({error}); describe in this process, or "
            "register it in a module"
        ) from error
    return choice
