"""How the simulation's functions are compiled: as fusion_core's are, and kept beside the simulation's own sources."""

from pathlib import Path

from fusion_core.compilation import Compiler

compiled = Compiler(Path(__file__).parent)
