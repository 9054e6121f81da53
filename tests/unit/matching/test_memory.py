"""Matching long drives stays under 1 GB resident, by blocks."""

import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = """
import sys
from pathlib import Path
import numpy as np
import retraverse as rt
from retraverse.techniques import ArraySpec, Descriptions, Layout
from retraverse.techniques.summarising.vectors import cosine_similarity

class Wide:
    name, summary, citation, version, parameters = "wide", "", "", 1, None
    layout = Layout("global", {"descriptor": ArraySpec((4096,), "float32")})
    def similarity(self, queries, references):
        return cosine_similarity(queries, references, non_negative=False)

class Route:
    technique = Wide()
    def __init__(self, descriptions):
        self.descriptions = descriptions
    def __len__(self):
        return len(self.descriptions)
    def blocks(self, max_bytes):
        rows = max_bytes // (4 * 4096)
        for start in range(0, len(self), rows):
            yield start, self.descriptions[start:start + rows]

n = int(sys.argv[1])
random = np.random.default_rng(0)
unit = random.standard_normal((n, 4096), np.float32)
unit /= np.linalg.norm(unit, axis=1, keepdims=True)
drive = Descriptions({"descriptor": unit})
matches = rt.match(drive, Route(drive), sequence_length=10)
assert (matches.reference == np.arange(n - 9)).all()
# Not ru_maxrss: a child inherits that of the process it was forked from.
status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
print(int(status["VmHWM"].split()[0]) // 1024)
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory is read from /proc")
def test_five_thousand_frames_of_4096_values() -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, "5000"], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    megabytes = int(done.stdout)
    print(f"peak resident: {megabytes} MB")
    assert megabytes < 1024
