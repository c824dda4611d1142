"""Faults in which values go into which test, in the check of a design, and in the audit of printed figures."""

from __future__ import annotations

from tests.mutants.mutant import Mutant
from tests.pipeline.analysis import (
    test_cases,
    test_design_check,
    test_families,
    test_measure,
    test_missing,
    test_model_rows,
    test_orders,
    test_ranking,
    test_shown_at_selection,
)
from tests.pipeline.analysis import test_totals as test_questionnaire_totals
from tests.pipeline.analysis.audit import (
    test_audit,
    test_conventions,
    test_granularity,
    test_holm,
    test_no_false_accusation,
    test_p_values,
    test_printed_files,
    test_signed_rank,
    test_totals,
)
from tests.pipeline.sessions import test_movements, test_replay, test_sessions, test_set_aside
from tests.pipeline.simulation import test_simulation
from tests.pipeline.statistics import (
    test_against_r,
    test_equivalence_and_bayes,
    test_follow_ups,
    test_models,
    test_statistics,
)
from tests.pipeline.study import test_tables_in

_MEASURE = (test_measure, test_tables_in)
_SESSIONS = (test_measure, test_tables_in, test_sessions, test_set_aside)
_OF_MODELS = (test_models, test_equivalence_and_bayes, test_follow_ups)
_COMPARED = (test_model_rows, test_measure, test_against_r, test_statistics, *_OF_MODELS)
_CASES = (test_families, test_cases, test_measure, *_OF_MODELS)
_DESIGN = (test_design_check,)
_AUDIT = (test_audit, test_printed_files, test_no_false_accusation)
_RANKED = (test_ranking, test_replay)

MUTANTS = (
    # From trials and tables to values.
    Mutant(
        'if "total" in scales or not has_total(str(questionnaire)):',
        'if "total" in scales:',
        (test_questionnaire_totals,),
    ),
    Mutant('if set(rated["scale"]) == scales:', 'if set(rated["scale"]) <= scales:', _MEASURE),
    Mutant('rated["value"].sum(), rated["n"].min()', 'rated["value"].mean(), rated["n"].min()', _MEASURE),
    Mutant(
        'in_px.assign(value=in_px["value"] * study.display.px_per_mm**2)',
        'in_px.assign(value=in_px["value"] * study.display.px_per_mm)',
        _SESSIONS,
    ),
    Mutant(
        'recorded = _chosen(trials, trials["estimator"] == "recorded")\n    recorded = recorded.assign',
        "recorded = trials\n    recorded = recorded.assign",
        _SESSIONS,
    ),
    Mutant("duration_s=duration_s.where(duration_s >= 0)", "duration_s=duration_s", _MEASURE),
    Mutant('if axis == "z" else pd.Series(True', 'if axis == "" else pd.Series(True', _MEASURE),
    Mutant("max(selections) - min(begins)", "min(selections) - min(begins)", _SESSIONS),
    Mutant('efficiency=moved["shortest_mm"] / covered', 'efficiency=covered / moved["shortest_mm"]', (test_movements,)),
    Mutant(
        "if excluded.session is None:\n            rows = rows[~matches(excluded, rows)]",
        "if False:\n            pass",
        _SESSIONS,
    ),
    Mutant('bad = values[~np.isfinite(values["value"])]', 'bad = values[values["value"].isna()]', _MEASURE),
    # Descriptives.
    Mutant('"mean": float(np.sqrt(row["mean"])),', '"mean": row["mean"],', _SESSIONS),
    Mutant(
        'known.groupby([*cell, "participant"])["squared_error_mm2"].mean()',
        'known.groupby([*cell, "participant"])["squared_error_mm2"].max()',
        (test_shown_at_selection,),
    ),
    Mutant(
        "float(np.sqrt(errors[condition, estimator].mean()))",
        "float(np.sqrt(errors[condition, estimator]).mean())",
        (test_shown_at_selection,),
    ),
    # Comparisons.
    Mutant('row["contrast"] is not None and pairs[row["measure"], row["effect"]] > 1', "False", _CASES),
    Mutant('key = (MEASURES, str(number), row["effect"])', "key = (MEASURES, str(number))", _CASES),
    Mutant(
        'key = (PAIRS, str(number), row["effect"], row["measure"])', 'key = (PAIRS, str(number), row["effect"])', _CASES
    ),
    Mutant("and not _follows_up(entry, row, rows)", "", _CASES),
    Mutant("wide.drop(index=[person for person in lacking if person in wide.index]).dropna()", "wide.dropna()", _CASES),
    Mutant(
        "lacking = {person: cells for person, cells in lacking.items() if wide.loc[person].isna().any()}",
        "pass",
        _CASES,
    ),
    Mutant(
        'expression.fullmatch(name) and not (is_pattern and name.endswith("/total"))',
        "expression.fullmatch(name)",
        (test_families,),
    ),
    Mutant('"reduction": 1 - second / first if', '"reduction": second / first - 1 if', _COMPARED),
    Mutant('{"mean_difference": first - second,', '{"mean_difference": second - first,', _COMPARED),
    Mutant('pairs[row["measure"], row["effect"]] > 1', 'pairs[row["measure"], row["effect"]] > 3', _COMPARED),
    Mutant("return levels if numbers.isna().any() else", "return levels if True else", (*_DESIGN, *_COMPARED)),
    Mutant(
        'if factor == "condition":\n        return list(study.conditions)',
        'if factor == "condition":\n        return sorted(study.conditions)',
        _COMPARED,
    ),
    # Rows of models.
    Mutant(
        'weighted = rows.assign(value=rows["value"] * rows["n"])',
        'rows = rows.assign(n=1)\n    weighted = rows.assign(value=rows["value"] * rows["n"])',
        _COMPARED,
    ),
    Mutant('value=sums["value"] / sums["n"], n=1)', 'value=sums["value"] / sums["n"])', _COMPARED),
    Mutant("(participant, int(period) + 1): condition", "(participant, int(period) - 1): condition", _COMPARED),
    Mutant("rows[[period > 1 for _, period in places]]", "rows[[period > 0 for _, period in places]]", _COMPARED),
    Mutant(
        "first_came_first.append(min(periods[first]) < min(periods[second]))",
        "first_came_first.append(min(periods[first]) > min(periods[second]))",
        _COMPARED,
    ),
    # Orders, and the check of a design.
    Mutant("SOURCES = (LOGS, MEASURES, PARTICIPANTS)", "SOURCES = (PARTICIPANTS, MEASURES, LOGS)", _DESIGN),
    Mutant("len(listed) > 1 and len(set(listed)) == len(listed)", "len(listed) > 1", _DESIGN),
    Mutant("whole.index(session.condition) + 1", "whole.index(session.condition)", (test_orders,)),
    Mutant(
        'once = once[~once.duplicated(["participant", "condition"], keep=False)]',
        'once = once[~once.duplicated(["participant", "condition"])]',
        (test_orders,),
    ),
    Mutant(
        "max(times) - min(times) <= (1 if over else 0)",
        "max(times) - min(times) <= 1",
        _DESIGN,
        "where nobody is over, the mean of the counts is a whole number, so counts that differ do so by two or more",
    ),
    Mutant("max(times) - min(times) <= (1 if over else 0)", "max(times) - min(times) <= 0", _DESIGN),
    Mutant("remark if result.p < alpha else None", "remark if result.p > alpha else None", _DESIGN),
    Mutant('("condition", "factor(period)"), "period")', '("condition", "period"), "period")', _DESIGN),
    Mutant("return _crossover(request)[2]", "return _crossover(request)[1]", _DESIGN),
    Mutant(
        'remark": uneven if counts.nunique() > 1 else None',
        'remark": uneven if counts.nunique() > 2 else None',
        _DESIGN,
    ),
    Mutant(
        "for (participant, condition), times in counts.items() if times > 1",
        "for (participant, condition), times in counts.items() if times > 2",
        _DESIGN,
    ),
    # What is not in the values.
    Mutant("if len(missing) == len(all_trials):", "if len(missing) == 0:", (test_missing,)),
    Mutant("excluded.session is None and excluded.covers(", "excluded.covers(", (test_missing,)),
    Mutant(
        "for participant in sorted(listed - set(named)):",
        "for participant in sorted(set(named) - listed):",
        (test_missing,),
    ),
    # Variants ranked.
    Mutant(
        'rows.sort(key=lambda row: row.get("rmse_mm", np.inf))',
        'rows.sort(key=lambda row: row.get("rmse_mm", 0.0))',
        _RANKED,
    ),
    Mutant('max(summary["ci_low"], possible[0])', 'summary["ci_low"]', _RANKED),
    Mutant('float(np.sqrt(max(0.0, summary["ci_low"])))', 'float(np.sqrt(abs(summary["ci_low"])))', _RANKED),
    Mutant(
        'known.groupby(["study", "session"])["squared_error_mm2"].mean()',
        'known.groupby(["study", "session"])["squared_error_mm2"].median()',
        _RANKED,
    ),
    Mutant("set.intersection(*per_study)", "set.union(*per_study)", _RANKED),
    # Reductions of simulated studies.
    Mutant("(1.0 - both[second] / both[first])", "(both[second] / both[first])", (test_simulation,)),
    Mutant("np.percentile(share, [2.5, 97.5])", "np.percentile(share, [5, 95])", (test_simulation,)),
    # The audit: arithmetic.
    Mutant(
        "(_ONE - after.interval / before.interval) * 100", "(_ONE - before.interval / after.interval) * 100", _AUDIT
    ),
    Mutant("grain = cell.steps.grain * Fraction(times, cell.n)", "grain = cell.steps.grain * times", _AUDIT),
    Mutant(
        "factor = Fraction(1, len(parts)) if total.average is not None",
        "factor = Fraction(1, len(parts)) if total.sum is not None",
        _AUDIT,
    ),
    Mutant(
        "return ceil((low - possible.low) / grain) <= floor((high - possible.low) / grain)",
        "return True",
        (test_totals,),
    ),
    Mutant(
        "exact = Fraction(100 * share.count, share.of)", "exact = Fraction(100 * share.count, share.of + 1)", _AUDIT
    ),
    Mutant(
        "percent.high - percent.low >= Fraction(100, share.of)",
        "percent.high - percent.low > Fraction(1000, share.of)",
        _AUDIT,
    ),
    # The audit: cells.
    Mutant("first, last = ceil(low), floor(high)", "first, last = floor(low), ceil(high)", (test_granularity,)),
    Mutant("first += (first - total) % 2", "", (test_granularity, *_AUDIT)),
    Mutant("(n, n - 1) if cell.population else (n - 1, n)", "(n - 1, n) if cell.population else (n, n - 1)", _AUDIT),
    Mutant("grain = steps.grain if n % 2 else steps.grain / 2", "grain = steps.grain", _AUDIT),
    Mutant("largest = squares / (n if cell.population else n - 1)", "largest = squares / n", _AUDIT),
    Mutant("grain = scale.step.value / scale.items", "grain = scale.step.value", _AUDIT),
    Mutant("interval.high - interval.low >= steps.grain / n", "interval.high - interval.low >= steps.grain", _AUDIT),
    # The audit: tests.
    Mutant(
        '_LESS_THAN_N = {"t_paired": 1, "correlation": 2}', '_LESS_THAN_N = {"t_paired": 1, "correlation": 1}', _AUDIT
    ),
    Mutant("expected = first.value * (n - 1)", "expected = first.value * n", _AUDIT),
    Mutant("(test.n or sum(ns)) - len(groups)", "(test.n or sum(ns)) - 1", _AUDIT),
    Mutant(
        "half, rest = (low / 2, high / 2), (1 - high / 2, 1 - low / 2)",
        "half, rest = (low / 2, high / 2), (1 - high, 1 - low)",
        (test_conventions,),
    ),
    Mutant("sqrt(n) * _ratio(low, first[1] + second[1])", "sqrt(n) * _ratio(low, max(first[1], second[1]))", _AUDIT),
    Mutant("variance * (n - 1) for variance, n in zip", "variance * n for variance, n in zip", _AUDIT),
    Mutant("factor = sqrt(cell.n / (cell.n - 1)) if cell.population else 1.0", "factor = 1.0", (test_conventions,)),
    Mutant(
        "room = max((float(step.max()) for step in steps if step.size), default=0.0)",
        "room = 0.0",
        (test_p_values,),
    ),
    Mutant("2 * special.stdtr(df[0], -abs(statistic))", "special.stdtr(df[0], -abs(statistic))", (test_p_values,)),
    Mutant("np.sqrt(1 - min(abs(statistic), 1.0) ** 2)", "(1 - min(abs(statistic), 1.0) ** 2)", (test_p_values,)),
    Mutant("[first * factor, second * factor]", "[first * factor, second]", (test_p_values,)),
    Mutant("return False if low > alpha else None", "return False", _AUDIT),
    Mutant("if bounds[0] > alpha:\n                lost", "if bounds[1] > alpha:\n                lost", (test_holm,)),
    Mutant(
        "test.p_adjusted.interval.high >= test.p.interval.low",
        "test.p_adjusted.interval.low >= test.p.interval.high",
        _AUDIT,
    ),
    # The audit: signed ranks.
    Mutant("doubled_midrank = 2 * done + size + 1", "doubled_midrank = 2 * done + size", (test_signed_rank,)),
    Mutant(
        "yield from _tied(0, n, shorter_too=True)", "yield from _tied(0, n, shorter_too=False)", (test_signed_rank,)
    ),
    Mutant(
        "squares / 4 - np.array(_tie_sums(ranked), dtype=np.float64) / 48",
        "squares / 4 - np.array(_tie_sums(ranked), dtype=np.float64) / 12",
        (test_signed_rank,),
    ),
    Mutant(
        "reachable[filled - size] << ((size**3 - size) // 6)",
        "reachable[filled - size] << ((size**2 - size) // 6)",
        (test_signed_rank,),
    ),
    Mutant("for correction in (0, 1) if sides == 2", "for correction in (0,) if sides == 2", (test_signed_rank,)),
    Mutant('{"exact": sides / 2**n,', '{"exact": sides / 2 ** (n - 1),', (test_signed_rank,)),
    Mutant(
        "max(ceil(printed.low * 2), 0) <= min(floor(printed.high * 2), n * (n + 1))",
        "max(ceil(printed.low), 0) <= min(floor(printed.high), n * (n + 1))",
        _AUDIT,
    ),
)
