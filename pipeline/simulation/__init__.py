"""Simulated recordings with known truth, written as ordinary study files. Everything after is the ordinary path."""

from pathlib import Path

from fusion_core.compilation import keep_apart

keep_apart(Path(__file__).parent)
