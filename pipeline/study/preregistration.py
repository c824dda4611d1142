"""preregistered.yaml: the settings that were frozen before the study, with a digest that tells whether they still are.

The file is text: the settings, and as its last line the SHA-256 of everything above that line, as
`head -n -1 preregistered.yaml | sha256sum` gives it. A digest in the file itself finds a slip, not a forger, who would
write a new one; the page that is handed to OSF or AsPredicted has the digest too, and that one nobody can change.
Line ends count as one character, for version control may turn one kind into the other.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import yaml
from pydantic import Field

from pipeline.errors import PipelineError
from pipeline.study.comparison import OPTIONS, Comparison
from pipeline.study.fields import Frozen, Id
from pipeline.study.folder import PREREGISTERED
from pipeline.study.preregistration_settings import Preregistration
from pipeline.study.scoring_settings import Scoring
from pipeline.study.settings import Exclusion, Study
from pipeline.study.table_settings import Factor
from pipeline.study.yaml_text import parse, read_yaml

_HEAD = """\
# What study.yaml said when this study was preregistered. Written by `steadyhand plan --preregister`; do not edit it.
# `steadyhand report` sets what was done beside it. The last line is the SHA-256 of all lines above it.
"""
_DIGEST_KEY = "sha256"


class Registered(Frozen):
    """The settings that decide what is tested, of whom and how."""

    title: str = ""
    conditions: Annotated[tuple[Id, ...], Field(min_length=1)]
    shown: Mapping[Id, str] = {}
    factors: Mapping[Id, Factor] = {}
    scoring: Mapping[Id, Scoring] = {}
    comparisons: tuple[Comparison, ...] = ()
    alpha: Annotated[float, Field(gt=0, lt=1)] = 0.05
    exclusions: tuple[Exclusion, ...] = ()
    question: tuple[tuple[Id, Id], ...] | None = None  # None in files from before pairs were frozen
    preregistration: Preregistration = Preregistration()


@dataclass(frozen=True)
class FrozenFile:
    """What preregistered.yaml holds, the digest that it states, and the one that it has."""

    registered: Registered
    stated_digest: str | None
    digest: str

    @property
    def is_intact(self) -> bool:
        """Is it as it was written?"""
        return self.stated_digest == self.digest


def registered_of(study: Study) -> Registered:
    """What a preregistration freezes of a study."""
    return Registered(**{name: getattr(study, name) for name in Registered.model_fields})


def frozen_text(registered: Registered) -> tuple[str, str]:
    """preregistered.yaml of these settings, the same for the same settings, and its digest."""
    content: dict[str, Any] = registered.model_dump(mode="json", exclude_none=True)
    content["comparisons"] = [_stated(entry) for entry in registered.comparisons]
    # YAML takes these for ends of lines, and PyYAML would not read them back; escaped, it does.
    readable = not any(character in json.dumps(content, ensure_ascii=False) for character in "\x85\u2028\u2029")
    body = _HEAD + yaml.safe_dump(content, sort_keys=False, allow_unicode=readable, width=110)
    digest = _digest(body)
    return f"{body}{_DIGEST_KEY}: {digest}\n", digest


def _stated(entry: Comparison) -> dict[str, Any]:
    """All that an entry says, defaults too, for a later version may have others; not what means nothing in it."""
    meaningless = OPTIONS - set(entry.options) | (set() if entry.draws_at_random else {"seed"})
    return entry.model_dump(mode="json", exclude=meaningless, exclude_none=True)


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def read_preregistered(folder: Path) -> FrozenFile | None:
    """What was preregistered of the study in this folder; None where nothing was.

    A file that was altered is read all the same, and says so. Raises PipelineError for one that cannot be read.
    """
    path = folder / PREREGISTERED
    if not path.exists():
        return None
    content = read_yaml(path)
    stated = content.pop(_DIGEST_KEY, None)
    lines = path.read_text(encoding="utf-8-sig").splitlines(keepends=True)
    above = "".join(line for line in lines if not line.startswith(f"{_DIGEST_KEY}:"))
    try:
        registered = parse(Registered, content, path)
    except PipelineError as error:
        raise PipelineError(
            f"{error}\n{path}: was not written like this by steadyhand plan --preregister; put the file back as it was"
            " registered, or take it out of the folder if this study is not preregistered"
        ) from None
    return FrozenFile(registered, None if stated is None else str(stated), _digest(above.replace("\r\n", "\n")))
