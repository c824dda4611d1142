"""`marker`: a page with a marker to print, for a webcam as tracker."""

from __future__ import annotations

from pathlib import Path

from pipeline.commands import console


def marker(number: int, size_mm: float, out: Path | None) -> None:
    """Write the page and say what comes next."""
    from pipeline.live.printed_marker import write

    path = out or Path(f"marker-{number}.pdf")
    path.parent.mkdir(parents=True, exist_ok=True)
    write(number, size_mm, path)
    console.say(f"{console.short_path(path)}: print it at 100 %, and see whether its ruler is 100 mm long.")
    console.say(f"In study.yaml: tracker: {{camera: {{marker: {number}, marker_mm: {size_mm:g}}}}} (docs/live.md)")
