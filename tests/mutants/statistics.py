"""Faults in tests, effect sizes, power and designs."""

from __future__ import annotations

from tests.mutants.mutant import Mutant
from tests.pipeline.statistics import (
    test_against_r,
    test_counterbalancing,
    test_diagnostics,
    test_equivalence_and_bayes,
    test_few_people,
    test_follow_ups,
    test_friedman,
    test_groups,
    test_logarithms,
    test_mixed_anova,
    test_mixed_models,
    test_models,
    test_power,
    test_power_designs,
    test_round_off,
    test_scoring,
    test_search,
    test_statistics,
)

_TESTS = (test_against_r, test_statistics)
_MODELS = (test_models, test_equivalence_and_bayes, test_follow_ups)
_POWER = (test_power,)
_FEW = (test_few_people,)
_DIAGNOSTICS = (test_diagnostics,)
_SEARCH = (test_search,)
_ORDERS = (test_counterbalancing,)
_FRIEDMAN = (test_friedman, test_against_r, test_statistics)
_GROUPS = (test_groups,)
_MIXED_ANOVA = (test_mixed_anova,)
_INTERCEPTS = (test_mixed_models,)
_SCORING = (test_scoring,)
_LOGARITHMS = (test_logarithms,)
_DESIGNS = (test_power_designs,)
_ROUND_OFF = (test_round_off, test_statistics)

MUTANTS = (
    # Analysis of variance.
    Mutant("return len(self.errors) * self.error_df", "return len(self.errors) * (self.error_df + 1)", _TESTS),
    Mutant("d, apart.T @ apart, n - 1)", "d, apart.T @ apart, n)", _TESTS),
    Mutant("effect_size=explained / (explained + variation)", "effect_size=explained / (explained + error)", _TESTS),
    Mutant("- apart.mean(axis=1, keepdims=True) + apart.mean()", "", _TESTS),
    Mutant("gg = 1 / (d * float(np.sum(relative**2)))", "gg = 1 / float(np.sum(relative**2))", _TESTS),
    Mutant("((error_df + 1) * d * gg - 2) / (d * room)", "((error_df + 1) * d * gg - 1) / (d * room)", _TESTS),
    Mutant(
        "min(1.0, ((error_df + 1) * d * gg - 2) / (d * room))", "((error_df + 1) * d * gg - 2) / (d * room)", _TESTS
    ),
    Mutant("if error_df >= d:", "if error_df > d:", _FEW),
    Mutant("float(np.prod(levels) * np.sum(", "float(np.sum(", _TESTS),
    Mutant('squared": explained / (explained + error)', 'squared": explained / (explained + df2 * error)', _TESTS),
    Mutant("-df * rho * np.log(w), d * (d + 1) / 2 - 1", "-df * rho * np.log(w), d * (d + 1) / 2", _TESTS),
    Mutant("first + second * (chi2_above(statistic, freedom + 4) - first)", "first", _TESTS),
    Mutant("f_above(statistic, gg * df1, gg * df2)", "f_above(statistic, gg * df1, df2)", _TESTS),
    # Aligned ranks.
    Mutant("values - values.mean(axis=0) + _effect(", "values + _effect(", _TESTS),
    Mutant("(-1) ** (len(effect) - size)", "(-1) ** size", _TESTS),
    # Bayes factors.
    Mutant(
        "(np.log(2 * np.pi) + 3 * log_g + np.exp(-log_g))", "(np.log(2 * np.pi) + 2 * log_g + np.exp(-log_g))", _TESTS
    ),
    Mutant("np.log1p(n * prior_scale**2 * np.exp(log_g))", "np.log1p(n * prior_scale * np.exp(log_g))", _MODELS),
    Mutant("-spread / 2 - (df + 1) / 2", "-spread / 2 - df / 2", _TESTS),
    # Crossover.
    Mutant("df = len(values) - 2", "df = len(values) - 1", _MODELS),
    Mutant("differences, early, (0.5, -0.5)", "differences, early, (-0.5, 0.5)", _MODELS),
    Mutant("(1 / len(groups[0]) + 1 / len(groups[1]))", "(4 / len(values))", _MODELS),
    Mutant("elif n < 3:", "elif n < 2:", _FEW),
    Mutant("elif early.all() or not early.any():", "elif early.all():", _FEW),
    # Descriptives and diagnostics.
    Mutant("t_quantile(0.975, n - 1) * float(np.std(", "t_quantile(0.975, n) * float(np.std(", _TESTS),
    Mutant('row["sd"] = float(np.std(values, ddof=1))', 'row["sd"] = float(np.std(values))', _TESTS),
    Mutant("_FAR_OUT = 3.5", "_FAR_OUT = 3.0", _DIAGNOSTICS),
    Mutant("_NORMAL_QUARTILE = 0.6745", "_NORMAL_QUARTILE = 1.0", _DIAGNOSTICS),
    Mutant("np.abs(_NORMAL_QUARTILE * apart / spread)", "_NORMAL_QUARTILE * apart / spread", _DIAGNOSTICS),
    Mutant("if 3 <= len(values) <= _SHAPIRO_UP_TO", "if 4 <= len(values) <= _SHAPIRO_UP_TO", _DIAGNOSTICS),
    # Effect sizes.
    Mutant(
        "standardized_interval(float(dz * np.sqrt(n)), n - 1,",
        "standardized_interval(float(dz * np.sqrt(n)), n,",
        _TESTS,
    ),
    Mutant("return bound(1 - tail), bound(tail)", "return bound(1 - 2 * tail), bound(2 * tail)", _TESTS),
    Mutant("np.mean(differences) / np.std(differences, ddof=1)", "np.mean(differences) / np.std(differences)", _TESTS),
    Mutant(
        "special.gammaln((df - 1) / 2)) / np.sqrt(df / 2)",
        "special.gammaln((df - 1) / 2)) / np.sqrt((df + 1) / 2)",
        _TESTS,
    ),
    Mutant("if df < 2:\n        return None", "if df < 1:\n        return None", _TESTS),
    Mutant("bound / (bound + df2)", "bound / (bound + df1 + df2 + 1)", _TESTS),
    Mutant("if below(0.0) < target:", "if below(0.0) < 0:", _TESTS),
    # Equivalence.
    Mutant("p=max(p_lower, p_upper)", "p=min(p_lower, p_upper)", _MODELS),
    Mutant("t_lower if p_lower >= p_upper else t_upper", "t_lower if p_lower <= p_upper else t_upper", _MODELS),
    Mutant(
        "(mean - bounds[0]) / error, (mean - bounds[1]) / error",
        "(mean - bounds[1]) / error, (mean - bounds[0]) / error",
        _MODELS,
    ),
    Mutant("t_quantile(0.95, df) * error", "t_quantile(0.975, df) * error", _MODELS),
    # Mixed models.
    Mutant(
        "np.sum(np.log(stretch), axis=1) + 2 * np.sum(np.log(diagonal), axis=1)",
        "np.sum(np.log(stretch), axis=1)",
        _MODELS,
    ),
    Mutant(
        "df2=df2,\n        p=f_above(statistic, df1, df2),\n        effect_size_name=",
        "df2=df2,\n        p=f_above(statistic, df1, df2 + 1),\n        effect_size_name=",
        _MODELS,
    ),
    Mutant("uncertainty=np.linalg.inv(second / 2)", "uncertainty=np.linalg.inv(second)", _INTERCEPTS),
    Mutant(
        "log_likelihood=float(-(solved.deviance + constant) / 2)",
        "log_likelihood=float(-solved.deviance / 2)",
        _INTERCEPTS,
    ),
    Mutant(
        "second[i, j] += 2 * (self.scores[part] @ block @ self.scores[other_part]) / residual**3", "pass", _INTERCEPTS
    ),
    Mutant(
        "second[0, 0] += 2 * (self.residuals @ moved) / residual**3",
        "second[0, 0] += (self.residuals @ moved) / residual**3",
        _INTERCEPTS,
    ),
    Mutant("single <= 2", "single <= 0", _MODELS),
    Mutant("2 * expected / (expected - q)", "float(single.mean())", _MODELS),
    Mutant("np.sum(single / (single - 2))", "np.sum(single / (single - 1))", _MODELS),
    Mutant("derivatives, 2 * np.linalg.inv(solved.curvature)", "derivatives, np.linalg.inv(solved.curvature)", _MODELS),
    Mutant("np.array([[2 * solved.residual**2 / rows.free]])", "np.array([[solved.residual**2 / rows.free]])", _MODELS),
    Mutant("total**-2.0 + (sizes - 1) / self.residual**2", "total**-2.0 + sizes / self.residual**2", _MODELS),
    Mutant("others = np.full((1, count), 1 / count)", "others = np.eye(count)[:1]", _MODELS),
    Mutant("np.eye(count)[0] - np.eye(count)[1:] if", "np.eye(count)[1:] - np.eye(count)[0] if", _MODELS),
    Mutant("np.zeros(hypotheses.shape[1]), -hypotheses", "np.zeros(hypotheses.shape[1]), hypotheses", _MODELS),
    Mutant("people + inside - terms < 1", "people + inside - terms < 0", _FEW),
    # Paired differences.
    Mutant("np.std(values, ddof=1) / np.sqrt(n))", "np.std(values) / np.sqrt(n))", _TESTS),
    Mutant("df = summary.n - 1\n    statistic, margin", "df = summary.n\n    statistic, margin", _TESTS),
    Mutant(
        "(np.var(scaled_first, ddof=1) + np.var(scaled_second, ddof=1)) / 2)",
        "np.var(scaled_first, ddof=1) + np.var(scaled_second, ddof=1))",
        _TESTS,
    ),
    Mutant("len(effect) > 1 or len(levels[effect[0]]) > 2", "len(effect) > 1 or len(levels[effect[0]]) > 1", _MODELS),
    Mutant('if factors[index] == "condition"), effect[0])', 'if factors[index] == ""), effect[0])', _MODELS),
    # Power.
    Mutant("stats.t.isf(alpha / 2, n - 1)), dz * np.sqrt(n)", "stats.t.isf(alpha, n - 1)), dz * np.sqrt(n)", _POWER),
    Mutant("return above + noncentral_t_cdf(-critical, n - 1, noncentrality)", "return above", _POWER),
    Mutant("n * conditions * f**2 / (1 - correlation)", "n * f**2 / (1 - correlation)", _POWER),
    Mutant("df2 = df1 * (n - 1)\n    noncentrality", "df2 = df1 * n\n    noncentrality", _POWER),
    Mutant(
        "self.difference / np.sqrt(2 * (1 - self.correlation))",
        "self.difference / np.sqrt(2 - self.correlation)",
        _POWER,
    ),
    Mutant("dz * np.sqrt(2 * (1 - correlation))", "dz * np.sqrt(2)", _POWER),
    Mutant(
        "means[0], means[-1] = self.difference / 2, -self.difference / 2",
        "means[0], means[-1] = self.difference, -self.difference",
        _POWER,
    ),
    Mutant("linalg.cholesky((1 - r) * np.eye(k) + r, lower=True)", "linalg.cholesky((1 - r) * np.eye(k) + r)", _POWER),
    Mutant("differences.std(axis=1, ddof=1)", "differences.std(axis=1)", _POWER),
    Mutant(
        "error**2 / (df1 * np.sum(covariance**2, axis=(1, 2)))", "error**2 / np.sum(covariance**2, axis=(1, 2))", _POWER
    ),
    Mutant("int(centre) if above is None else above - 1", "int(centre) if above is None else above", _POWER),
    Mutant("n * (n + 1) // 2 - w_plus) <= critical_w", "n * (n + 1) // 2 - w_plus) < critical_w", _POWER),
    Mutant(
        'has_correction = design.test == "rm_anova" and design.conditions > 2',
        'has_correction = design.test == "rm_anova"',
        _POWER,
    ),
    Mutant(
        "1 + int(1 - np.log2(design.alpha))", "int(1 - np.log2(design.alpha))", _POWER, "only where the search begins"
    ),
    Mutant("share(n).interval()[1] >= power", "share(n).interval()[0] >= power", _SEARCH),
    Mutant("below, reached, at, step = low - 1, high + 1", "below, reached, at, step = low, high + 1", _SEARCH),
    # Rank tests.
    Mutant("min(w_plus, float(ranks.sum()) - w_plus)", "w_plus", _TESTS),
    Mutant("min(1.0, 2 * _lower_tail(", "min(1.0, _lower_tail(", _TESTS),
    Mutant(
        "float(walsh[outside - 1]), float(walsh[-outside])", "float(walsh[outside]), float(walsh[-outside - 1])", _TESTS
    ),
    Mutant("(1 - level) / 2 * (1 + 1e-12)", "(1 - level) * (1 + 1e-12)", _TESTS),
    Mutant("np.triu_indices(n)", "np.triu_indices(n, 1)", _TESTS),
    Mutant("(n * squares - k * expected**2)", "(n * n * (k**3 - k) / 12)", _FRIEDMAN),
    Mutant("statistic = n * (k - 1) * agreement", "statistic = n * k * agreement", _TESTS),
    Mutant("f_above(f, k - 1, (k - 1) * (n - 1))", "f_above(f, k - 1, k * (n - 1))", _TESTS),
    Mutant("n * whole - (n - 1) * without", "n * whole - n * without", _TESTS),
    Mutant("/ 2) / np.sqrt(np.sum(ranks**2) / 4)", "/ 2) / np.sqrt(np.sum(ranks**2) / 2)", _TESTS),
    # Friedman's exact p.
    Mutant("np.sum(chances @ (squares >= observed))", "np.sum(chances @ (squares > observed))", _FRIEDMAN),
    Mutant("np.repeat(chances / len(orders), len(orders))", "np.repeat(chances, len(orders))", _FRIEDMAN),
    Mutant("sorted(set(permutations(row.tolist())))", "sorted(permutations(row.tolist()))[::2]", _FRIEDMAN),
    # Round-off.
    Mutant("sizes = np.where(sizes <= room, 0.0, sizes)", "", _ROUND_OFF),
    Mutant("_ROUND_OFF_STEPS = 64", "_ROUND_OFF_STEPS = 0", _ROUND_OFF),
    Mutant("np.where(told_apart, np.minimum(room, step / 2), room)", "room", _ROUND_OFF),
    Mutant("_KNOWN_TO = 1e-6", "_KNOWN_TO = 1.0", _ROUND_OFF),
    Mutant("(_ROUND_OFF * float(np.max(np.abs(values), initial=0.0))) ** 2", "0.0", _TESTS),
    # Groups of participants.
    Mutant(
        "shares.sum() ** 2 / np.sum(shares**2 / (sizes - 1)))\n    statistic",
        "shares.sum() ** 2 / np.sum(shares**2 / sizes))\n    statistic",
        _GROUPS,
    ),
    Mutant("pooled_df = float(sizes.sum() - 2)", "pooled_df = float(sizes.sum() - 1)", _GROUPS),
    Mutant("float(np.sqrt(variances.mean())), error, df", "float(np.sqrt(variances.sum())), error, df", _GROUPS),
    Mutant(
        "stats.studentized_range.ppf(0.95, groups, df)",
        "stats.studentized_range.ppf(0.975, groups, df)",
        _GROUPS,
    ),
    Mutant('"levene": "mean", "brown_forsythe": "median"', '"levene": "median", "brown_forsythe": "mean"', _GROUPS),
    Mutant("explained = min(1.0, statistic / (n - 1))", "explained = min(1.0, statistic / n)", _GROUPS),
    Mutant("(statistic - k + 1) / (n - k)", "(statistic - k + 1) / (n - 1)", _GROUPS),
    Mutant("u = float(ranks[:n].sum()) - n * (n + 1) / 2", "u = float(ranks[:n].sum()) - n * (n - 1) / 2", _GROUPS),
    Mutant("far = apart >= abs(", "far = apart > abs(", _GROUPS),
    Mutant("effect_size=2 * u / (n * m) - 1", "effect_size=u / (n * m)", _GROUPS),
    Mutant(
        "float(differences[outside - 1]), float(differences[-outside])",
        "float(differences[outside]), float(differences[-outside - 1])",
        _GROUPS,
    ),
    Mutant("0.025 * (1 - 1e-12)", "0.05 * (1 - 1e-12)", _GROUPS),
    Mutant("(np.cumsum(counts) - (counts - 1) / 2)[tie]", "np.cumsum(counts)[tie]", _GROUPS),
    Mutant("ties = 1 - float(", "ties = 1 - 0.0 * float(", _GROUPS),
    # Mixed analysis of variance.
    Mutant(
        "np.sum(means.mean(axis=0) ** 2) / np.mean(1 / sizes) * len(groups)",
        "np.sum(scores.mean(axis=0) ** 2) * len(scores)",
        _MIXED_ANOVA,
    ),
    Mutant("apart.T @ apart, len(scores) - len(groups)", "apart.T @ apart, len(scores) - 1", _MIXED_ANOVA),
    Mutant("Stratum(float(differ), d * (len(groups) - 1)", "Stratum(float(differ), d * len(groups)", _MIXED_ANOVA),
    Mutant(
        "float(np.sqrt(np.sum([1 / len(rows) for rows in groups]))) / len(groups)",
        "float(np.sqrt(1 / len(first)))",
        _MIXED_ANOVA,
    ),
    Mutant("float(np.mean([differences[rows].mean() for rows in groups]))", "float(differences.mean())", _MIXED_ANOVA),
    Mutant("df = len(first) - len(groups)", "df = len(first) - 1", _MIXED_ANOVA),
    # Questionnaires and ratios.
    Mutant("sum(limits) - value if item in reversed_items", "limits[1] - value if item in reversed_items", _SCORING),
    Mutant("100 * (mean - low) / (high - low)", "100 * mean / (high - low)", _SCORING),
    Mutant("mean - (low + high) / 2", "mean - (high - low) / 2", _SCORING),
    Mutant("float(np.average(values, weights=item_weights))", "float(np.average(values))", _SCORING),
    Mutant("all(total >= comb(count, 2)", "all(total >= 0", _SCORING),
    Mutant("df1, df2 = n - 1, (n - 1) * (k - 1)", "df1, df2 = n - 1, (n - 1) * k", _SCORING),
    Mutant("np.any(values <= 0)", "np.any(values < 0)", _LOGARITHMS),
    Mutant("logs = [(low + high) / 2, low, high]", "logs = [high - low, low, high]", _LOGARITHMS),
    # Power of further designs.
    Mutant("variances / variances.mean() / sizes", "variances / sizes", _DESIGNS),
    Mutant("(k**2 - 1) / (3 * float(np.sum((1 - weights", "(k**2 - 1) / (2 * float(np.sum((1 - weights", _DESIGNS),
    Mutant("1 + (cells - 1) * self.correlation", "1 + cells * self.correlation", _DESIGNS),
    Mutant("epsilon * contrasts * (people - self.groups)", "epsilon * contrasts * (people - 1)", _DESIGNS),
    Mutant("df = 2 * (n - 1) if self.groups else n - 1", "df = 2 * n - 1 if self.groups else n - 1", _DESIGNS),
    Mutant("np.sqrt((2 if self.groups else 1) / n)", "np.sqrt(1 / n)", _DESIGNS),
    # Orders.
    Mutant("return square if conditions % 2 == 0 else", "return square if conditions else", _ORDERS),
    Mutant("[order[::-1] for order in square]", "square", _ORDERS),
    Mutant("(place + 1) // 2 if place % 2 else -(place // 2)", "place", _ORDERS),
    Mutant("squares[len(orders) // conditions % len(squares)]", "squares[0]", _ORDERS),
    Mutant(
        "follows = Counter(pair for order in orders for pair in pairwise(order))",
        "follows = Counter(pair for order in orders for pair in permutations(order, 2))",
        _ORDERS,
    ),
)
