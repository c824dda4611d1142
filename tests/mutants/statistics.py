"""Faults in tests, effect sizes, corrections, power and designs."""

from __future__ import annotations

from tests.mutants.mutant import Mutant
from tests.pipeline.statistics import test_counterbalancing, test_models, test_power, test_statistics

_TESTS = (test_statistics,)
_MODELS = (test_models,)
_POWER = (test_power,)
_ORDERS = (test_counterbalancing,)

MUTANTS = (
    # Analysis of variance.
    Mutant("float(contrasts), float(contrasts * (n - 1))", "float(contrasts), float(contrasts * n)", _TESTS),
    Mutant("explained / (explained + other_variation)", "explained / (explained + error)", _TESTS),
    Mutant("float(np.prod(levels) * np.sum(", "float(np.sum(", _TESTS),
    Mutant("explained / (explained + error),", "explained / (explained + df2 * error),", _TESTS),
    Mutant("- flat.mean(axis=1, keepdims=True) + flat.mean()", "", _TESTS),
    Mutant("trace**2 / (d * float(np.sum(covariance**2)))", "trace**2 / float(np.sum(covariance**2))", _TESTS),
    Mutant("min(1.0, (n * d * gg - 2) / (d * room))", "min(1.0, (n * d * gg - 1) / (d * room))", _TESTS),
    Mutant("min(1.0, (n * d * gg - 2) / (d * room))", "(n * d * gg - 2) / (d * room)", _TESTS),
    Mutant("if n - 1 >= d:", "if n - 1 > d:", _TESTS),
    Mutant("-df * rho * np.log(w), d * (d + 1) / 2 - 1", "-df * rho * np.log(w), d * (d + 1) / 2", _TESTS),
    Mutant("first + second * (stats.chi2.sf(statistic, freedom + 4) - first)", "first", _TESTS),
    Mutant("stats.f.sf(statistic, gg * df1, gg * df2)", "stats.f.sf(statistic, gg * df1, df2)", _TESTS),
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
    Mutant("elif n < 3:", "elif n < 2:", _MODELS),
    Mutant("elif early.all() or not early.any():", "elif early.all():", _MODELS),
    # Descriptives and diagnostics.
    Mutant("stats.t.ppf(0.975, n - 1)) * sd", "stats.t.ppf(0.975, n)) * sd", _TESTS),
    Mutant("sd = float(np.std(values, ddof=1))", "sd = float(np.std(values))", _TESTS),
    Mutant("_FAR_OUT = 3.5", "_FAR_OUT = 3.0", _MODELS),
    Mutant("_NORMAL_QUARTILE = 0.6745", "_NORMAL_QUARTILE = 1.0", _MODELS),
    Mutant("np.abs(_NORMAL_QUARTILE * apart / spread)", "_NORMAL_QUARTILE * apart / spread", _MODELS),
    Mutant("if 3 <= len(values) <= _SHAPIRO_UP_TO", "if 4 <= len(values) <= _SHAPIRO_UP_TO", _MODELS),
    # Effect sizes.
    Mutant("np.mean(differences) / np.std(differences, ddof=1)", "np.mean(differences) / np.std(differences)", _TESTS),
    Mutant("noncentral_t_cdf(t, n - 1, shift) - target", "noncentral_t_cdf(t, n, shift) - target", _TESTS),
    Mutant(
        "special.gammaln((df - 1) / 2)) / np.sqrt(df / 2)",
        "special.gammaln((df - 1) / 2)) / np.sqrt((df + 1) / 2)",
        _TESTS,
    ),
    Mutant("if df < 2:\n        return None", "if df < 1:\n        return None", _TESTS),
    Mutant("found / (found + df2)", "found / (found + df1 + df2 + 1)", _TESTS),
    Mutant("if below(0.0) < target:", "if below(0.0) < 0:", _TESTS),
    # Equivalence.
    Mutant("p=max(p_lower, p_upper)", "p=min(p_lower, p_upper)", _MODELS),
    Mutant("t_lower if p_lower >= p_upper else t_upper", "t_lower if p_lower <= p_upper else t_upper", _MODELS),
    Mutant(
        "(mean - bounds[0]) / error, (mean - bounds[1]) / error",
        "(mean - bounds[1]) / error, (mean - bounds[0]) / error",
        _MODELS,
    ),
    Mutant("float(stats.t.ppf(0.95, df)) * error", "float(stats.t.ppf(0.975, df)) * error", _MODELS),
    # Mixed models.
    Mutant("single <= 2", "single <= 0", _MODELS),
    Mutant("2 * expected / (expected - q)", "float(single.mean())", _MODELS),
    Mutant("np.sum(single / (single - 2))", "np.sum(single / (single - 1))", _MODELS),
    Mutant("derivatives, 2 * np.linalg.inv(solved.curvature)", "derivatives, np.linalg.inv(solved.curvature)", _MODELS),
    Mutant("np.array([[2 * solved.residual**2 / rows.free]])", "np.array([[solved.residual**2 / rows.free]])", _MODELS),
    Mutant("+ 2 * np.sum(np.log(np.abs(np.diag(triangle))))", "", _MODELS),
    Mutant("return len(self.values) - int(self.design.shape[1])", "return len(self.values)", _MODELS),
    Mutant("total**-2.0 + (sizes - 1) / self.residual**2", "total**-2.0 + sizes / self.residual**2", _MODELS),
    Mutant("others = np.full((1, count), 1 / count)", "others = np.eye(count)[:1]", _MODELS),
    Mutant("np.eye(count)[0] - np.eye(count)[1:] if", "np.eye(count)[1:] - np.eye(count)[0] if", _MODELS),
    Mutant("np.zeros(hypotheses.shape[1]), -hypotheses", "np.zeros(hypotheses.shape[1]), hypotheses", _MODELS),
    Mutant("statistic * df1 / (statistic * df1 + df2)", "statistic / (statistic + df2)", _MODELS),
    Mutant("people + inside - terms < 1", "people + inside - terms < 0", _MODELS),
    # Multiplicity.
    Mutant("np.maximum.accumulate((m - np.arange(m)) * p[order])", "(m - np.arange(m)) * p[order]", _TESTS),
    Mutant("np.maximum.accumulate((m - np.arange(m)) * p[order])", "np.maximum.accumulate(m * p[order])", _TESTS),
    Mutant("np.minimum.accumulate(scaled[::-1])[::-1]", "scaled", _TESTS),
    Mutant("m / np.arange(1, m + 1)", "m / np.arange(m, 0, -1)", _TESTS),
    Mutant("np.minimum(1.0, m * p)", "m * p", _TESTS),
    Mutant(
        "index for index, p in enumerate(p_values) if p is not None",
        "index for index, p in enumerate(p_values) if p",
        _TESTS,
    ),
    # Paired differences.
    Mutant("float(np.std(values, ddof=1)) / np.sqrt(n)", "float(np.std(values)) / np.sqrt(n)", _TESTS),
    Mutant("p=float(2 * stats.t.sf(abs(statistic), df))", "p=float(stats.t.sf(abs(statistic), df))", _TESTS),
    Mutant(
        "(np.var(first, ddof=1) + np.var(second, ddof=1)) / 2", "np.var(first, ddof=1) + np.var(second, ddof=1)", _TESTS
    ),
    Mutant("len(levels[effect[0]]) < 3", "len(levels[effect[0]]) < 2", _MODELS),
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
    Mutant("share(n).interval()[1] >= power", "share(n).interval()[0] >= power", _POWER),
    Mutant("below, reached, at, step = low - 1, high + 1", "below, reached, at, step = low, high + 1", _POWER),
    # Rank tests.
    Mutant("min(w_plus, float(ranks.sum()) - w_plus)", "w_plus", _TESTS),
    Mutant("min(1.0, 2 * _lower_tail(", "min(1.0, _lower_tail(", _TESTS),
    Mutant("np.rint(2 * ranks).astype(np.int64)", "2 * ranks.astype(np.int64)", _TESTS),
    Mutant(
        "ranks, all_ranks = every[nonzero], float(every.sum())",
        "ranks, all_ranks = every[nonzero], float(every[nonzero].sum())",
        _TESTS,
    ),
    Mutant("nonzero = differences != 0", "nonzero = differences > 0", _TESTS),
    Mutant(
        "float(walsh[outside - 1]), float(walsh[-outside])", "float(walsh[outside]), float(walsh[-outside - 1])", _TESTS
    ),
    Mutant("(1 - level) / 2 * (1 + 1e-12)", "(1 - level) * (1 + 1e-12)", _TESTS),
    Mutant("np.triu_indices(n)", "np.triu_indices(n, 1)", _TESTS),
    Mutant("(n * squares - k * expected**2)", "(n * n * (k**3 - k) / 12)", _TESTS),
    Mutant("statistic = n * (k - 1) * agreement", "statistic = n * k * agreement", _TESTS),
    Mutant("stats.f.sf(f, k - 1, (k - 1) * (n - 1))", "stats.f.sf(f, k - 1, k * (n - 1))", _TESTS),
    Mutant("n * whole - (n - 1) * without", "n * whole - n * without", _TESTS),
    Mutant("np.sqrt(np.sum(ranks**2) / 4)", "np.sqrt(np.sum(ranks**2) / 2)", _TESTS),
    Mutant("np.tanh(z - margin)), float(np.tanh(z + margin))", "z - margin), float(z + margin)", _TESTS),
    # Round-off.
    Mutant("np.floor(np.log10(largest)) - 11", "np.floor(np.log10(largest)) - 17", _TESTS),
    Mutant("(_ROUND_OFF * float(np.max(np.abs(values), initial=0.0))) ** 2", "0.0", _TESTS),
    Mutant("return rounded(first - second, first, second)", "return first - second", _TESTS),
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
