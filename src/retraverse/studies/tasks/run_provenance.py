"""What it takes to repeat a run, as the JSON text of its record."""

import json
import platform
from datetime import UTC, datetime
from functools import lru_cache

import numpy as np

from retraverse import kernels
from retraverse._version import __version__
from retraverse.metrics import DEFINITIONS
from retraverse.studies.tasks.runs import CODE, Job

__all__ = ["RunProvenance"]

_DEFINED = ("accuracy", "accuracy_interval", "auc", "p_r100", "r_p100", "ep")


class RunProvenance:
    """What it takes to repeat a run, as JSON; the same text for all runs of a job."""

    def __init__(self) -> None:
        self._common = {
            "version": __version__,
            "code": list(CODE),
            "definitions": {name: DEFINITIONS[name] for name in _DEFINED},
            "versions": _versions(),
            "machine": f"{platform.machine()}, {platform.system()}",
            "kernel_backend": kernels.backend(),
            "created": datetime.now(UTC).isoformat(timespec="seconds"),
        }

    def of(self, job: Job) -> str:
        """Return the provenance of a job's runs."""
        sides = {
            name: {
                "name": drive.traverse.name,
                "sha256": drive.content_hash,
                "n_frames": len(drive.traverse),
                "pictures": worsening.label,
            }
            for name, (drive, worsening) in zip(("query", "reference"), job.sides, strict=True)
        }
        technique = {"technique": dict(job.identity), "citation": job.dataset.known.citation}
        sources = [drive.traverse.source for drive in (job.query, job.reference)]
        return json.dumps({**self._common, **sides, **technique, "sources": sources}, default=str)


@lru_cache(maxsize=1)
def _versions() -> dict[str, str]:
    import cv2
    import duckdb
    import PIL

    return {
        "python": platform.python_version(),
        "numpy": np.__version__,
        "opencv": cv2.__version__,
        "pillow": PIL.__version__,
        "duckdb": duckdb.__version__,
    }
