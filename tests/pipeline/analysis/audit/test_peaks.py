"""The printed peak of a cross-correlation against the lag that it is said to be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.analysis.audit.audit import audit
from pipeline.analysis.audit.finding import AGREEMENT, CONTRADICTION, Finding
from pipeline.errors import PipelineError
from pipeline.study.printed import load_publication


def audited(folder: Path, peak: str) -> Finding:
    path = folder / "printed.yaml"
    path.write_text(f"source: S\nmeasures: [{{name: m, cells: {{a: {{mean: 1}}}}}}]\npeaks: [{{label: Fig, {peak}}}]\n")
    (finding,) = [finding for finding in audit(load_publication(path)) if finding.check == "lag"]
    return finding


def test_the_papers_lag_follows_from_its_peak(tmp_path: Path) -> None:
    """Feng, Murray-Smith and Ramsay (2016), Fig. 9: the peak at 190 of 359, at 90 Hz, is 0.11 s."""
    finding = audited(tmp_path, "at: 190, of: 359, rate_hz: 90, lag_s: 0.11")
    assert finding.verdict == AGREEMENT
    assert finding.explanation == "10 samples from the middle at 90 Hz"


def test_another_lag_is_a_contradiction(tmp_path: Path) -> None:
    finding = audited(tmp_path, "at: 190, of: 359, rate_hz: 90, lag_s: 0.21")
    assert (finding.verdict, finding.follows) == (CONTRADICTION, "0.11 s")


@pytest.mark.parametrize(
    ("peak", "message"),
    [
        ("at: 190, of: 358, rate_hz: 90, lag_s: 0.11", "an odd number"),
        ("at: 360, of: 359, rate_hz: 90, lag_s: 0.11", "should be at most 359"),
        ("at: 190, of: 359, rate_hz: 0, lag_s: 0.11", "should be more than 0"),
    ],
)
def test_what_cannot_be_is_said(tmp_path: Path, peak: str, message: str) -> None:
    with pytest.raises(PipelineError, match=message):
        audited(tmp_path, peak)


@given(samples=st.integers(8, 40), data=st.data())
def test_the_place_is_that_of_numpys_correlation(
    tmp_path_factory: pytest.TempPathFactory, samples: int, data: st.DataObject
) -> None:
    first, second = data.draw(st.integers(0, samples - 1)), data.draw(st.integers(0, samples - 1))
    signal, late = np.eye(samples)[first], np.eye(samples)[second]
    at = int(np.argmax(np.correlate(late, signal, "full"))) + 1
    peak = f"at: {at}, of: {2 * samples - 1}, rate_hz: 100, lag_s: {(second - first) / 100:.2f}"
    assert audited(tmp_path_factory.mktemp("peak"), peak).verdict == AGREEMENT
