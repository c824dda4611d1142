"""What `steadyhand audit` says of effect sizes, intervals, ranks of groups, changes, mixed designs and known scales."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.analysis.audit.finding import AGREEMENT, CONTRADICTION, REMARK, UNCHECKED
from pipeline.errors import PipelineError
from tests.pipeline.analysis.audit.printed import audited, of_measure, of_test


@pytest.mark.parametrize(
    ("test", "verdict", "follows"),
    [
        # partial η² of a published F: 6.94 · 2 / (6.94 · 2 + 58)
        ("F: 6.94, df: [2, 58], n: 30, test: rm_anova, partial_eta_squared: .19", AGREEMENT, "0.19"),
        ("F: 6.94, df: [2, 58], n: 30, test: rm_anova, partial_eta_squared: .21", CONTRADICTION, "0.19"),
        ("F: 10.86, df: [1, 11], test: rm_anova, partial_eta_squared: .50", AGREEMENT, "0.50"),
        ("t: 3.30, df: 11, test: t_paired, partial_eta_squared: .50", AGREEMENT, "0.50"),
        ("F: 4.2, df: [2, 19], test: rm_anova, partial_eta_squared: .325", REMARK, "0.242 to 0.365"),
        ("F: 6.94, partial_eta_squared: .193", UNCHECKED, ""),
        ("t: 3.30, df: 11, test: t_paired, d_z: 0.95", AGREEMENT, "0.95"),
        ("t: 3.30, test: t_paired, d_z: 0.95", AGREEMENT, "0.95"),
        ("F: 10.89, df: [1, 11], test: rm_anova, d_z: 0.95", AGREEMENT, "0.95"),
        ("t: 3.30, df: 11, test: t_paired, d_z: -0.95", AGREEMENT, "0.95"),
        ("t: 3.30, df: 11, test: t_paired, d_z: 0.89", REMARK, "0.88 to 0.89"),
        ("t: 3.30, df: 11, test: t_paired, d_z: 1.35", CONTRADICTION, "0.95"),
        ("t: 3.30, df: 11, d_z: 0.95", UNCHECKED, ""),
        ("t: 3.30, df: 11, test: t_paired, d: 0.95", AGREEMENT, "0.95"),
        ("t: 3.30, df: 11, test: t_paired, d: 0.40", UNCHECKED, ""),
        ("z: -2.35, test: wilcoxon, effect_r: .68", AGREEMENT, "0.68"),
        ("z: -2.35, test: wilcoxon, effect_r: .48", REMARK, "0.48"),
        ("z: -2.35, test: wilcoxon, effect_r: .71", REMARK, "0.68 to 2.35"),
        ("z: -2.35, test: wilcoxon, effect_r: .30", CONTRADICTION, "0.68"),
    ],
)
def test_effect_sizes_from_their_statistics(tmp_path: Path, test: str, verdict: str, follows: str) -> None:
    found = of_test(tmp_path, test)["effect size"]
    assert (found.verdict, found.follows) == (verdict, follows)


GROUPS = "cells: {a: {n: 10, mean: 5.1, sd: 1.2}, b: {n: 12, mean: 6.3, sd: 1.4}}"


@pytest.mark.parametrize(
    ("test", "verdict", "explanation"),
    [
        ("t: 2.13, test: t_independent, d: 0.91", AGREEMENT, "follows"),
        ("t: 2.13, test: t_independent, d: 0.88", REMARK, "Hedges' g"),
        ("t: 2.13, test: t_independent, d: 0.95", REMARK, "2t/√df"),
        ("t: 2.13, test: t_independent, d: 1.00", REMARK, "the first SD"),
        ("t: 2.13, test: t_independent, d: 0.60", CONTRADICTION, "does not follow"),
        ("t: 2.17, test: welch, d: 0.91", UNCHECKED, "equal n"),
        ("U: 28, p: .037, test: mann_whitney", AGREEMENT, "few values tie"),
        ("U: 92, p: .037, test: mann_whitney", AGREEMENT, "few values tie"),
        ("U: 28, p: .018, test: mann_whitney", REMARK, "one-sided"),
        ("U: 28, p: .4, test: mann_whitney", REMARK, "unless many values tie"),
        ("U: 125, p: .037, test: mann_whitney", CONTRADICTION, "groups of 10 and 12 cannot have this U"),
        ("U: 28.3, p: .037, test: mann_whitney", CONTRADICTION, "cannot have this U"),
        ("U: 28, z: 1.2, test: mann_whitney", CONTRADICTION, "for some ties"),
        ("U: 28, z: 2.14, test: mann_whitney, effect_r: .46", AGREEMENT, ""),
        ("p: .0000001, test: mann_whitney", CONTRADICTION, "a p this small"),
        ("p: .04, test: mann_whitney", AGREEMENT, "for some ties"),
        ("H: 4.3, df: 1, p: .038, test: kruskal", AGREEMENT, "cannot be larger"),
        ("chi2: 22.4, df: 1, p: '< .001', test: kruskal", CONTRADICTION, "cannot be larger"),
    ],
)
def test_groups(tmp_path: Path, test: str, verdict: str, explanation: str) -> None:
    """Of 10 and 12 participants."""
    found = of_measure(tmp_path, f"{GROUPS}, tests: [{{{test}}}]", "")
    own = [found[check] for check in ("ranks of groups", "effect size") if check in found]
    assert (own[0].verdict, explanation in own[0].explanation) == (verdict, True), own
    if "effect_r" in test:
        assert own[-1].verdict == AGREEMENT


def test_ranks_of_groups_need_the_size_of_every_group(tmp_path: Path) -> None:
    for test in ("U: 28, p: .04, test: mann_whitney", "H: 4.3, df: 1, test: kruskal"):
        found = of_measure(tmp_path, f"cells: {{a: {{}}, b: {{}}}}, tests: [{{{test}}}]")["ranks of groups"]
        assert (found.verdict, found.explanation) == (UNCHECKED, "n of every group is needed")


@pytest.mark.parametrize(
    ("test", "verdict", "explanation"),
    [
        ("discordant: [7, 1], p: .070", AGREEMENT, "exact or by χ²"),
        ("discordant: [7, 1], p: .039", AGREEMENT, "exact or by χ²"),
        ("discordant: [7, 1], chi2: 4.50, df: 1, p: .034", AGREEMENT, "exact or by χ²"),
        ("discordant: [7, 1], chi2: 3.13, df: 1, p: .077", AGREEMENT, "exact or by χ²"),
        ("discordant: [7, 1], p: .017", REMARK, "one-sided"),
        ("discordant: [7, 1], p: .017, sides: 1", AGREEMENT, "exact or by χ²"),
        ("discordant: [7, 1], chi2: 6.50, df: 1, p: .011", CONTRADICTION, "χ² of these numbers"),
        ("discordant: [7, 1], p: .5", CONTRADICTION, "p of these numbers"),
        ("discordant: [12, 4]", CONTRADICTION, "16 changed, of 12"),
        ("discordant: [0, 0], p: 1.0", CONTRADICTION, "nobody changed"),
        ("chi2: 14.2, df: 1, p: '< .001'", CONTRADICTION, "cannot exceed the number of participants"),
        ("p: .03", UNCHECKED, "are needed"),
    ],
)
def test_mcnemar_of_twelve_participants(tmp_path: Path, test: str, verdict: str, explanation: str) -> None:
    found = of_test(tmp_path, f"test: mcnemar, {test}")["McNemar"]
    assert (found.verdict, explanation in found.explanation) == (verdict, True), found


@pytest.mark.parametrize(
    ("test", "verdict"),
    [
        ("F: 3.1, df: [2, 26], p: .062", AGREEMENT),
        ("F: 3.1, df: [1, 13], p: .102", AGREEMENT),
        ("F: 3.1, df: [1.62, 21.06], p: .075", AGREEMENT),
        ("F: 3.1, df: [2, 28], p: .061", REMARK),  # such as 2.4 and 27.6
        ("F: 3.1, df: [1, 14], p: .100", CONTRADICTION),
    ],
)
def test_degrees_of_freedom_of_a_mixed_design(tmp_path: Path, test: str, verdict: str) -> None:
    """Fifteen participants in two groups or more leave 13 for each of an effect's own."""
    assert of_test(tmp_path, f"test: mixed_anova, {test}", "n: 15")["degrees of freedom"].verdict == verdict
    assert of_test(tmp_path, f"test: mixed_anova, {test}", "")["degrees of freedom"].verdict == UNCHECKED


@pytest.mark.parametrize(
    ("interval", "file", "verdict"),
    [
        ("ci: [4.22, 5.98]", "", AGREEMENT),
        ("ci: [4.31, 5.89]", "", REMARK),  # the normal distribution's
        ("ci: [4.31, 5.89]", "intervals: t\n", CONTRADICTION),
        ("ci: [4.6, 5.6]", "", REMARK),
        ("ci: [4.38, 5.82], ci_level: 90", "", AGREEMENT),
        ("ci: [5.98, 4.22]", "", CONTRADICTION),
    ],
)
def test_intervals_of_a_mean(tmp_path: Path, interval: str, file: str, verdict: str) -> None:
    """M = 5.10, SD = 1.23, n = 10: 5.10 ± 2.262 · 1.23/√10."""
    measure = f"cells: {{a: {{n: 10, mean: 5.10, sd: 1.23, {interval}}}}}"
    assert of_measure(tmp_path, measure, file)["interval"].verdict == verdict


def test_an_interval_needs_mean_sd_and_n(tmp_path: Path) -> None:
    found = of_measure(tmp_path, "cells: {a: {mean: 5.10, ci: [4.2, 6.0]}}", "")["interval"]
    assert (found.verdict, found.explanation) == (UNCHECKED, "mean, SD and n are needed")


@pytest.mark.parametrize(
    ("scale", "mean", "verdict"),
    [
        ("sus", "72.92", AGREEMENT),  # 875/12
        ("sus", "72.90", CONTRADICTION),  # no multiple of 2.5/12
        ("sus", "101.0", CONTRADICTION),
        ("raw_tlx", "42.36", AGREEMENT),  # 610 gradations of 5/6 over 12
        ("raw_tlx", "42.33", CONTRADICTION),
    ],
)
def test_means_that_questionnaires_can_have(tmp_path: Path, scale: str, mean: str, verdict: str) -> None:
    found = of_measure(tmp_path, f"scale: {scale}, cells: {{a: {{mean: {mean}}}}}")
    assert found["GRIM"].verdict == verdict


@pytest.mark.parametrize(
    ("measure", "message"),
    [
        ("scale: suss", 'scale: "suss" is not known; did you mean "sus"?'),
        ("tests: [{test: kruskal, U: 3}]", "only test: mann_whitney has an U"),
        ("tests: [{test: t_paired, discordant: [1, 2]}]", "only test: mcnemar has a discordant"),
        ("tests: [{test: kruskal, H: 3, chi2: 3}]", "give each statistic a test of its own"),
    ],
)
def test_keys_that_do_not_fit(tmp_path: Path, measure: str, message: str) -> None:
    with pytest.raises(PipelineError) as error:
        audited(tmp_path, f"measures: [{{name: m, {measure}}}]\n")
    assert message in str(error.value)
