"""What a study says of query pictures without a region of interest: once, not once a task."""

from retraverse.studies.plans.plan import TechniqueChoice
from retraverse.studies.tasks.describe_task import made_technique
from retraverse.techniques.handmade.regional_hog import RegionalHog

__all__ = ["EmptyRoiCount"]


class EmptyRoiCount:
    """Counts them over all pairs of drives; a picture at one c counts once for each map."""

    def __init__(self) -> None:
        self._found: dict[tuple[str, float], tuple[RegionalHog, int, int]] = {}

    def add(self, choice: TechniqueChoice, n_empty: int, n_pictures: int) -> None:
        """Count one pair of drives; techniques without regions do not count."""
        technique = made_technique(choice)
        if isinstance(technique, RegionalHog):
            key = (technique.name, technique.parameters.roi_entropy)
            _, empty, pictures = self._found.get(key, (technique, 0, 0))
            self._found[key] = (technique, empty + n_empty, pictures + n_pictures)

    def say(self) -> None:
        """Warn of what was counted, in one line for each technique and threshold."""
        for technique, empty, pictures in self._found.values():
            if empty:
                technique.warn_of_empty_roi(empty, pictures)
