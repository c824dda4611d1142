"""What the first run of a process does but once, done when this is imported: late imports, digests of the code."""

from __future__ import annotations

import pyarrow.pandas_compat  # noqa: F401
import statsmodels.stats.proportion  # noqa: F401

from pipeline.engine.code_digest import code_digest
from pipeline.sessions.logs.mcap import ros2  # noqa: F401
from pipeline.stages import STAGES

DIGESTS = [code_digest(stage.module) for stage in STAGES]
