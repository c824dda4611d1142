"""One stage of a study's only session in a process of its own: processor time in s, and the most memory held in GB.

`python -m tests.benchmarks.stage STUDY FOLDER STAGE`; the tables of each stage go to a folder of its name.
"""

from __future__ import annotations

import resource
import sys
import time
from importlib import import_module
from pathlib import Path

from pipeline.engine.stage import Work
from pipeline.study.folder import load_study
from pipeline.study.session_files import find_sessions

STAGES = ("ingest", "fuse", "assess")


def main() -> None:
    root, folder, stage = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3]
    study, out = load_study(root), folder / stage
    (session,) = find_sessions(root, study).sessions
    out.mkdir(parents=True)
    entries = {name: (folder / name,) for name in STAGES}
    began = time.process_time()
    import_module(f"pipeline.sessions.{stage}").run(Work("study", study, root, out, (session,), entries))
    most_gb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"{time.process_time() - began:.1f} {most_gb:.2f}")


if __name__ == "__main__":
    main()
