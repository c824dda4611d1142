"""`make test-browser`: the pages at three widths, with the keyboard's and the scripts' work, and axe-core.

`ARGS=reports` takes the reports' pages alone, `ARGS=live` those of the live study, `ARGS="live reload"` some of them.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

from tests.browser import axe
from tests.browser.chromium import BrowserError, Tab, found, tab
from tests.browser.complaints import complaint
from tests.browser.live.run import looks, results
from tests.browser.studies import written

WIDTHS = {390: 844, 768: 1024, 1280: 900}
_CHECKS = (Path(__file__).parent / "checks.js").read_text(encoding="utf-8")
_FAULTY = """<!doctype html><html lang="en"><title>Faulty</title><main><h1>Faulty</h1><img src="http://127.0.0.1:9/a.png">
<div style="width: 3000px">wide</div><table><tr><td>loose</td></tr></table>
<p>First words</p><p style="margin-top: -2.2rem">Second words</p>
<details class="folded" open><summary>Fold</summary><figure id="f"></figure></details></main>
<script>console.error("faulty"); throw new Error("thrown")</script>"""
_MUST_BE_FOUND = (
    "px wide",
    "a request leaves",
    "the console",
    "an exception",
    "in no part that scrolls",
    "overprinted",
    "open before anybody asked",
    "not all are printed",
)


def check(page: Path, opened: Tab, checker: str | None) -> Iterator[str]:
    """Everything that is wrong with a page, at each width, in light and in dark."""
    for width, height in WIDTHS.items():
        for scheme in ("light", "dark"):
            opened.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
            opened.call(
                "Emulation.setDeviceMetricsOverride",
                width=width,
                height=height,
                deviceScaleFactor=1,
                mobile=width < 700,
            )
            opened.open(page.as_uri())
            at = f"{width} px, {scheme}"
            yield from (f"{at}: {fault}" for fault in _at_width(page, opened, checker))


def _at_width(page: Path, opened: Tab, checker: str | None) -> Iterator[str]:
    opened.evaluate(f"{_CHECKS};0")
    if page.name == "traces.html":
        yield from opened.evaluate("playerFaults()")
        yield from opened.evaluate("tracesFaults()")
    else:
        yield from opened.evaluate("sortingFaults()")
        yield from opened.evaluate("foldFaults()")
        yield from opened.evaluate("nameFaults()")
        yield from opened.evaluate("copyFaults()")
        yield from opened.evaluate("overprintFaults()")
    yield from opened.evaluate("scrollFaults()")
    yield from opened.evaluate("overflowFaults()")
    if checker is not None:
        opened.evaluate(f"{checker};0")
        yield from opened.evaluate("accessibilityFaults()")
    yield from filter(None, (complaint(event, ("file:", "data:")) for event in opened.events))


def _finds_faults(folder: Path, opened: Tab, checker: str | None) -> list[str]:
    """What of the faults of a page that has every one is not found."""
    page = folder / "faulty.html"
    page.write_text(_FAULTY, encoding="utf-8")
    found = "; ".join(check(page, opened, checker))
    wanted = [*_MUST_BE_FOUND, *(["axe: image-alt"] if checker is not None else [])]
    return [f"a page with this fault passed: {fault}" for fault in wanted if fault not in found]


def _reports(checker: str | None) -> Iterator[tuple[str, list[str]]]:
    with tempfile.TemporaryDirectory() as folder, tab() as opened:
        yield "faults are found", _finds_faults(Path(folder), opened, checker)
        for page in written(Path(folder), "html"):
            name = page.relative_to(Path(folder) / "out")
            yield f"{name} ({page.stat().st_size / 1e6:.2f} MB)", list(check(page, opened, checker))


def main(part: str = "", *words: str) -> int:
    """Print what is wrong with each page; 1 where anything is, 2 where there is no browser."""
    counts = {True: 0, False: 0}

    def say(name: str, faults: list[str]) -> None:
        print("\n         ".join([f"  {'failed' if faults else 'ok    '} {name}", *dict.fromkeys(faults)]))
        counts[not faults] += 1

    try:
        found()
        checker = axe.source()
        if part != "live":
            for name, faults in _reports(checker):
                say(name, faults)
        if part != "reports":
            wanted = " ".join(words)
            for name, faults in chain(results(wanted), looks(checker, wanted)):
                say(name, faults)
    except (BrowserError, RuntimeError) as error:
        print(f"make test-browser: {error}", file=sys.stderr)
        return 2
    print(f"{counts[True]} passed, {counts[False]} failed")
    return 1 if counts[False] else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
