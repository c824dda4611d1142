"""`python -m tests.mutants`: every mutant in a copy of the sources, and which of them no test notices."""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue

from tests.conftest import CLONE
from tests.mutants import accuracy, analysis, estimates, statistics
from tests.mutants.copies import BROKEN, SURVIVED, Copy, copy_to, sources_in
from tests.mutants.mutant import Mutant, place

MUTANTS = (*accuracy.MUTANTS, *statistics.MUTANTS, *estimates.MUTANTS, *analysis.MUTANTS)


def main() -> int:
    options = _options()
    sources = sources_in(CLONE)
    chosen = [mutant for mutant in MUTANTS if all(word in mutant.change for word in options.words)]
    faults = [f"{fault}: {mutant.change}" for mutant in chosen if isinstance(fault := place(mutant, sources), str)]
    for fault in faults:
        print(f"ERROR {fault}")
    if options.check or not chosen:
        print(f"{len(chosen)} mutants, {len(faults)} with errors")
        return bool(faults)
    found = [mutant for mutant in chosen if not isinstance(place(mutant, sources), str)]
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        outcomes = _tried(found, Path(folder), options.jobs)
    return _said(outcomes, len(faults))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("words", nargs="*", help="only mutants in whose changed line all of these stand")
    parser.add_argument("--check", action="store_true", help="only say whether every mutant's text is still there")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="how many at a time")
    options: argparse.Namespace = parser.parse_args()
    return options


def _tried(mutants: list[Mutant], folder: Path, jobs: int) -> list[tuple[Mutant, str]]:
    """What became of each mutant; the tests must pass in an unchanged copy first."""
    copies: SimpleQueue[Copy] = SimpleQueue()
    for number in range(jobs):
        copies.put(copy_to(folder / str(number)))

    def tried(mutant: Mutant) -> tuple[Mutant, str]:
        copy = copies.get()
        try:
            outcome = copy.outcome_of(mutant)
        finally:
            copies.put(copy)
        print(f"{outcome:9} {mutant.change}", flush=True)
        return mutant, outcome

    first = copies.get()
    print("the tests without a mutant ...", flush=True)
    if failure := first.failure_of({test for mutant in mutants for test in mutant.tests}):
        sys.exit(f"{failure}\nERROR the tests fail without a mutant")
    copies.put(first)
    with ThreadPoolExecutor(jobs) as threads:
        return list(threads.map(tried, mutants))


def _said(outcomes: list[tuple[Mutant, str]], faults: int) -> int:
    """The share killed and what survived; 1 where something is to be done."""
    survived = [mutant for mutant, outcome in outcomes if outcome == SURVIVED]
    broken = [mutant for mutant, outcome in outcomes if outcome == BROKEN]
    noticed = [mutant for mutant, outcome in outcomes if mutant.equivalent and outcome != SURVIVED]
    counted = [mutant for mutant, _ in outcomes if not mutant.equivalent]
    lost = [mutant for mutant in survived if not mutant.equivalent]
    killed = len(counted) - len(lost) - len(broken)
    print(f"\n{killed} of {len(counted)} mutants killed ({killed / max(len(counted), 1):.0%})")
    for mutant in survived:
        print(f"survived: {mutant.change}" + (f" (equivalent: {mutant.equivalent})" if mutant.equivalent else ""))
    for mutant in noticed:
        print(f"ERROR said to be equivalent, and killed: {mutant.change}")
    for mutant in broken:
        print(f"ERROR no test could run: {mutant.change}")
    return bool(lost or noticed or broken or faults)


if __name__ == "__main__":
    sys.exit(main())
