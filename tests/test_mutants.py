"""A mutant whose text is gone from the sources is a fault that no test is tried against any more."""

from __future__ import annotations

from tests.conftest import CLONE
from tests.mutants.__main__ import MUTANTS
from tests.mutants.copies import sources_in
from tests.mutants.mutant import place


def test_the_text_of_every_mutant_stands_once_in_the_sources() -> None:
    sources = sources_in(CLONE)
    faults = [f"{found}: {mutant.change}" for mutant in MUTANTS if isinstance(found := place(mutant, sources), str)]
    assert not faults, "\n".join(faults)


def test_every_mutant_changes_something_and_stands_in_the_list_once() -> None:
    assert all(mutant.old != mutant.new for mutant in MUTANTS)
    assert len({(mutant.old, mutant.new) for mutant in MUTANTS}) == len(MUTANTS)
