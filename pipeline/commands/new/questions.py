"""What `new` asks: on a terminal the person, elsewhere nobody, so that the likeliest answer is taken and said."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from pipeline.commands import console

Read = Callable[[str], str]
"""Shows a prompt and returns the line that the person types."""


@dataclass
class Questions:
    """Asks by `read`, or takes the likeliest answer where it is None. `taken` lists these with their options."""

    read: Read | None
    taken: list[str] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)

    def choose(self, question: str, likely: str, option: str, choices: Sequence[str] = ()) -> str:
        """The answer; an empty line means the likely one. `option` is the flag that answers beforehand."""
        if self.read is None:
            self.taken.append(f"{question} {likely} ({option} to say otherwise)")
            return likely
        self.asked.append(question)
        named = f" ({' | '.join(choices)})" if choices else ""
        while True:
            answer = self.read(f"{question}{named} [{likely}] ").strip() or likely
            if not choices or answer in choices:
                return answer
            console.say(f"  {answer} is none of {', '.join(choices)}")


def of_terminal() -> Questions:
    """Questions to the person at the terminal, if there is one."""
    on_terminal = sys.stdin.isatty() and sys.stdout.isatty()
    return Questions(input if on_terminal else None)
