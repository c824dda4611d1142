"""A bag of ROS 2 as a folder: what its metadata.yaml says of its files, held against what they hold."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from pipeline.sessions.logs.log import Log

METADATA = "metadata.yaml"
_METADATA_LIMIT = 2**20  # bytes


def missing_parts(metadata: Path, files: Sequence[Path]) -> list[str]:
    """Faults: files that the metadata lists and the folder lacks. A folder may be read without its metadata."""
    there = {file.name for file in files}
    listed = [Path(str(name)).name for name in _information(metadata).get("relative_file_paths") or []]
    packed = {name: (name, f"{name}.zstd") for name in listed}
    return [
        f"{METADATA} lists {name}, which is not there"
        for name, names in packed.items()
        if not there.intersection(names)
    ]


def missing_messages(metadata: Path, log: Log) -> list[str]:
    """Faults: topics of which the metadata counts more messages than the files hold."""
    faults = []
    for one in _information(metadata).get("topics_with_message_count") or []:
        name, count = (one.get("topic_metadata") or {}).get("name"), one.get("message_count")
        readings = log.topics.get(str(name))
        if readings is not None and isinstance(count, int) and readings.lost is not None:
            missing = count - readings.read - readings.lost
            if missing > 0:
                faults.append(f"{METADATA} counts {missing} more messages of {name} than its files hold")
    return faults


def _information(metadata: Path) -> dict[str, Any]:
    """What the metadata say; nothing where they cannot be read, for the files speak for themselves."""
    if metadata.stat().st_size > _METADATA_LIMIT:
        return {}
    try:
        content = yaml.safe_load(metadata.read_text(encoding="utf-8", errors="replace"))
    except yaml.YAMLError:
        return {}
    information = content.get("rosbag2_bagfile_information") if isinstance(content, dict) else None
    return information if isinstance(information, dict) else {}
