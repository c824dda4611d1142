"""Faults in adjusting, rank correlation, resampling, errors and counts, practice and Fitts' law."""

from __future__ import annotations

from tests.mutants.mutant import Mutant
from tests.pipeline.statistics import (
    test_errors_and_counts,
    test_estimation,
    test_learning_and_fitts,
    test_multiplicity,
    test_rank_biserial,
)

_ADJUSTED = (test_multiplicity,)
_RANKS = (test_rank_biserial,)
_ESTIMATION = (test_estimation,)
_ERRORS = (test_errors_and_counts,)
_LAWS = (test_learning_and_fitts,)

MUTANTS = (
    # Multiplicity.
    Mutant('METHODS = {\n    "holm": "holm",', 'METHODS = {\n    "holm": "bonferroni",', _ADJUSTED),
    Mutant('METHODS = {\n    "holm": "holm",', 'METHODS = {\n    "holm": "simes-hochberg",', _ADJUSTED),
    Mutant('"fdr_by",\n    "hochberg"', '"fdr_bh",\n    "hochberg"', _ADJUSTED),
    Mutant('"hochberg": "simes-hochberg"', '"hochberg": "hommel"', _ADJUSTED),
    Mutant('"sidak": "sidak",\n    "holm_sidak"', '"sidak": "bonferroni",\n    "holm_sidak"', _ADJUSTED),
    Mutant('"holm_sidak": "holm-sidak"', '"holm_sidak": "sidak"', _ADJUSTED),
    Mutant(
        "index for index, p in enumerate(p_values) if p is not None",
        "index for index, p in enumerate(p_values) if p",
        _ADJUSTED,
    ),
    # Signed ranks and their correlation.
    Mutant("nonzero = np.abs(differences), differences != 0", "nonzero = np.abs(differences), differences > 0", _RANKS),
    Mutant("np.where(nonzero, ranks - np.count_nonzero(~nonzero), 0.0)", "np.where(nonzero, ranks, 0.0)", _RANKS),
    Mutant("np.tanh(np.arctanh(r) + sign * margin)", "r + sign * margin", _RANKS),
    Mutant("_error(differences, ranks) / (1 - r**2)", "_error(differences, ranks)", _RANKS),
    Mutant("2 * ((1 - level) / 2) ** (1 / m) - 1", "2 * (1 - level) ** (1 / m) - 1", _RANKS),
    Mutant("sign * ranks - larger - equal / 2", "sign * ranks - larger - equal", _RANKS),
    Mutant("(max(low, 1 / total), high) if r > 0", "(low, high) if r > 0", _RANKS),
    # Bootstrap, permutation, intervals within participants.
    Mutant('method="BCa"', 'method="percentile"', _ESTIMATION),
    Mutant("_ROUND_OFF * float(np.abs(values).sum())", "0.0", _ESTIMATION),
    Mutant("2 * reaching / (float(len(first_half))", "reaching / (float(len(first_half))", _ESTIMATION),
    Mutant("np.sqrt(k / (k - 1) / n)", "np.sqrt(1 / n)", _ESTIMATION),
    # Errors and counts.
    Mutant("df = float(len(people) - len(levels))", "df = float(len(people) - 1)", _ERRORS),
    Mutant("df2 = df - q + 1", "df2 = df", _ERRORS),
    Mutant("weights @ estimated.covariance @ weights", "weights @ estimated.uncorrected @ weights", _ERRORS),
    Mutant("p - float(stats.binom.pmf(b, b + c, 0.5))", "p - float(stats.binom.pmf(b, b + c, 0.5)) / 2", _ERRORS),
    Mutant("(b + 1) / (n + 2), (c + 1) / (n + 2)", "b / n, c / n", _ERRORS),
    Mutant("statistic / (n * (k - 1)),\n        ci_low", "statistic / (n * k),\n        ci_low", _ERRORS),
    # Practice.
    Mutant("np.log(orders[rows]), np.log(values[rows])", "orders[rows], np.log(values[rows])", _LAWS),
    Mutant("float(2**slope)", "float(np.exp(slope))", _LAWS),
    Mutant('"n_without_slope": people - len(first)', '"n_without_slope": len(first)', _LAWS),
    # Fitts' law.
    Mutant("stats.t.ppf(0.975, m - 2)", "stats.t.ppf(0.975, m - 1)", _LAWS),
    Mutant("float(np.mean(x / y))", "float(np.mean(x) / np.mean(y))", _LAWS),
    Mutant("= np.log2(amplitude / width + 1)", "= np.log2(amplitude / width)", _LAWS),
    Mutant("np.log2(amplitude / width + 1), time, own", "np.log2(2 * amplitude / width), time, own", _LAWS),
)
