"""Readers as bad as other people's C can be."""

import os
import time
from pathlib import Path

import numpy as np

from retraverse.weights.weight_file import WeightFile


def read_here(path: Path) -> WeightFile:
    """Do what the file says."""
    match path.read_text():
        case "never end":
            time.sleep(60)
        case "crash":
            os.abort()
        case "print":
            print("noise")
    return WeightFile({"a": np.arange(3.0)}, {"said": "yes"}, "bad")
