"""Which of the LSL outlets there are can feed a stream, and what is said where none can."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pipeline.errors import PipelineError
from pipeline.live.adapters.feeds import counts
from pipeline.study.recording import Lsl

_NAMED = 12  # streams in a message
_TEXT = 3  # a channel format of LSL


@dataclass(frozen=True)
class Found:
    """An outlet that was found."""

    name: str
    channels: int
    host: str
    is_text: bool = False

    @classmethod
    def of(cls, info: Any) -> Found:
        """That of a `pylsl.StreamInfo`."""
        return cls(info.name(), info.channel_count(), info.hostname(), info.channel_format() == _TEXT)


def check(stream: str, content: str, settings: Lsl, where: str) -> None:
    """Raise PipelineError where there are not as many channels as the stream has figures, or pylsl is not there."""
    begin = f"{where}: recording: senders.{stream}: lsl:"
    if len(settings.channels) not in counts(content):
        wanted = " or ".join(map(str, counts(content)))
        raise PipelineError(f"{begin} channels: {len(settings.channels)} are named, {content} needs {wanted}")
    try:
        import pylsl  # noqa: F401
    except ImportError:
        raise PipelineError(f'{begin} needs a further package: pip install "steadyhand[lsl]"') from None
    except (OSError, RuntimeError) as error:
        raise PipelineError(f"{begin} LSL's library cannot be loaded here ({error}); install liblsl") from None


def unfit(settings: Lsl, outlets: Sequence[Found]) -> str:
    """Why none of the outlets that were found can be listened to; empty where one can."""
    named = f'"{settings.name}"'
    own = [one for one in outlets if one.name == settings.name]
    if not own:
        others = sorted({one.name for one in outlets})[:_NAMED]
        there = f"found {', '.join(others)}" if others else "there is none at all"
        return f"no LSL stream is named {named}; {there}. Start it, or correct the name; see the firewall too."
    if len(own) > 1:
        hosts = " and ".join(sorted(one.host for one in own))
        return f"{len(own)} LSL streams are named {named} (on {hosts}); end all but one, or rename them."
    if own[0].is_text:
        return f"the LSL stream {named} holds text; name one that holds numbers."
    count, highest = own[0].channels, max(settings.channels)
    if highest >= count:
        return f"the LSL stream {named} has {count} channels; channels: names number {highest}, counted from 0."
    return ""
