"""What a BIDS dataset says of itself and of its participants."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pandas as pd

from pipeline.commands.export_bids.files import descriptions, write_json, write_tsv
from pipeline.study.settings import Study

BIDS_VERSION = "1.10.0"
_README = """# {title}

Written by Steadyhand {version} from the study's logs. Every stream of a session is a tracking system (`tracksys`),
every condition an acquisition (`acq`). Samples stand as they were read: nothing is filtered, resampled or left out. The
last two channels of each motion.tsv are of type LATENCY: when a sample was stamped, and when it arrived, in seconds
from the recording's onset, which is `acq_time` in scans.tsv. What estimators make of them is not part of this dataset.
{notes}"""


def write_dataset(
    study: Study, people: Mapping[str, str], columns: Mapping[str, Mapping[str, str]], folder: Path
) -> None:
    """Write the files at the top. `people` are the labels of participants, `columns` what participants.csv says."""
    title = study.title or "A study of target selection"
    described: dict[str, Any] = {
        "Name": title,
        "BIDSVersion": BIDS_VERSION,
        "DatasetType": "raw",
        "GeneratedBy": [{"Name": "Steadyhand", "Version": version("steadyhand")}],
        **({"HowToAcknowledge": study.citation} if study.citation else {}),
    }
    write_json(folder / "dataset_description.json", described)
    notes = f"\n{study.notes.strip()}\n" if study.notes.strip() else ""
    readme = _README.format(title=title, version=version("steadyhand"), notes=notes)
    (folder / "README.md").write_text(readme, encoding="utf-8")
    _write_participants(people, columns, folder)


def _write_participants(people: Mapping[str, str], columns: Mapping[str, Mapping[str, str]], folder: Path) -> None:
    rows = [
        {
            "participant_id": f"sub-{label}",
            "study_id": name,
            **{column: values.get(name) for column, values in columns.items()},
        }
        for name, label in people.items()
    ]
    write_tsv(folder / "participants.tsv", pd.DataFrame(rows))
    about = {"study_id": "The participant's name in the study."}
    about |= dict.fromkeys(columns, "As participants.csv of the study says.")
    write_json(folder / "participants.json", descriptions(about))
