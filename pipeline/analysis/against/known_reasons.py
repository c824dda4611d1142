"""Why another program's figure may differ from ours, each reason verified on the data at hand.

A reason is a record: which figures of which procedures it may explain, what it says, and `in_their_way`, which computes
the figure as the other program does. It explains a difference only where that meets the other program's figure to
1e-6, so that no reason is given because it sounds right. The first that meets it is the one that is said.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from pipeline.analysis.against import conventions, derivatives, digits, ways
from pipeline.analysis.against.problems import P_ADJUSTED
from pipeline.statistics.arrays import FloatArray


@dataclass(frozen=True)
class KnownReason:
    """Why figures of some procedures may differ; `in_their_way` computes each of `quantities`."""

    procedures: tuple[str, ...]
    quantities: tuple[str, ...]
    text: str
    in_their_way: ways.Way


_FLOATS = "differences as floats have them: round-off breaks ties and zeros; ours rounds to the data's decimals"
_VALUES = "values as floats have them: round-off breaks ties; ours rounds to the data's decimals"
_NORMAL = "normal approximation, taken where there are ties, zeros or many values; ours is exact"
_CONTINUITY = (
    "normal approximation with continuity correction, taken where there are ties, zeros or many values; ours is exact"
)


def _wilcoxon(as_floats: bool, pratt: bool | None) -> list[KnownReason]:
    """Every combination of what may differ: how differences are taken, zeros, and the approximation of p."""
    others = [_FLOATS] * as_floats + ["zeros are dropped, not ranked (Pratt)"] * (pratt is False)

    def reason(quantity: str, text: str, figure: Callable[[FloatArray, bool], float | None]) -> KnownReason:
        whole = "; ".join([text] * bool(text) + others)
        return KnownReason(("wilcoxon",), (quantity,), whole, ways.of_differences(figure, as_floats, pratt))

    plain = [
        reason("statistic", "", conventions.w_plus),
        reason("p", "", conventions.signed_rank_exact_p),
        reason("effect_size", "", conventions.rank_biserial),
    ]
    return [
        *(plain if others else []),
        reason("statistic", "the smaller of W₊ and W₋; ours is W₊", conventions.smaller_w),
        reason("p", _NORMAL, conventions.signed_rank_normal_p),
        reason("p", _CONTINUITY, conventions.signed_rank_corrected_p),
        reason("p", "exact p of ranks without ties and zeros", conventions.signed_rank_table_p),
    ]


_PAIRED = (
    KnownReason(("t_paired",), ("statistic", "p"), _FLOATS, ways.of_data(conventions.t_of_floats)),
    KnownReason(
        ("t_paired",),
        ("effect_size",),
        "another effect size: d_av, over the mean variance of the two conditions, without its sign; ours is d_z",
        ways.of_data(conventions.d_av),
    ),
    KnownReason(("bayes_t",), ("statistic",), "its prior scale is √2/2 = 0.70711; ours is 0.707", ways.medium_prior),
    KnownReason(
        ("bayes_t",),
        ("statistic",),
        "its integration over g from 0 to ∞ misses digits in the long tail of a t this large; ours is over ln g",
        ways.integrated_over_g,
    ),
)

_FRIEDMAN = (
    KnownReason(("friedman",), ("p",), "p by the χ² approximation; ours is exact", ways.instead("chi2_p")),
    KnownReason(
        ("friedman",), ("statistic", "p", "effect_size"), _VALUES, ways.of_data(conventions.friedman_of_floats)
    ),
)

_ANOVAS = ("rm_anova", "mixed_anova")
_PLAIN_MEAN = (
    "groups of unequal size weigh by their size; ours, as afex and SPSS, takes the plain mean of the groups (type III)"
)
_ANALYSES = (
    KnownReason(
        _ANOVAS,
        ("p",),
        "corrected for sphericity by Greenhouse and Geisser; ours is not, and p_gg stands beside it",
        ways.instead("p_gg"),
    ),
    KnownReason(_ANOVAS, ("df1", "df2"), "times ε of Greenhouse and Geisser; ours is not", ways.times("epsilon_gg")),
    KnownReason(
        _ANOVAS,
        ("effect_size",),
        "another effect size: partial η²; ours is generalized η²",
        ways.instead("partial_eta_squared"),
    ),
    KnownReason(
        _ANOVAS,
        ("mauchly_w", "mauchly_p"),
        "there is no such test of so few participants; its formula gives 0",
        ways.no_mauchly,
    ),
    KnownReason(
        ("rm_anova",),
        ("statistic", "p", "p_gg"),
        "its digits run out, for the values are far larger than what they differ by; exact fractions give ours",
        digits.run_out,
    ),
    KnownReason(("mixed_anova",), ("statistic", "p", "p_gg"), _PLAIN_MEAN, ways.weighted_by_group),
    KnownReason(
        ("mixed_anova",),
        ("effect_size",),
        f"another effect size: partial η²; ours is generalized η². And {_PLAIN_MEAN}",
        ways.weighted_by_group,
    ),
)

_GROUPS = (
    KnownReason(
        ("t_welch",),
        ("statistic", "df2", "p", "ci_difference_low", "ci_difference_high"),
        "Student's t with one variance for both groups, taken where they are of the same size; ours is Welch's",
        ways.of_data(conventions.student),
    ),
    KnownReason(
        ("t_welch",),
        ("effect_size",),
        "another effect size: d_s, over the pooled SD, without its sign; ours is d_av, and d_s stands in the details",
        ways.size_of("cohen_ds"),
    ),
    KnownReason(
        ("games_howell",),
        ("effect_size",),
        "another effect size: Hedges' g, which is d_s times 1 − 3 / (4N − 9), N being the values of the two groups",
        ways.hedges_g,
    ),
    KnownReason(
        ("anova_welch",),
        ("effect_size",),
        "another effect size: η² of the analysis with one variance for all groups; ours is of Welch's F",
        ways.of_data(conventions.eta_squared),
    ),
    KnownReason(("mann_whitney",), ("p",), _CONTINUITY, ways.of_data(conventions.rank_sum_corrected_p)),
    KnownReason(("mann_whitney",), ("p",), _NORMAL, ways.of_data(conventions.rank_sum_normal_p)),
    KnownReason(("mann_whitney",), ("statistic", "p"), _VALUES, ways.of_data(conventions.rank_sum_of_floats)),
)

_OF_MODEL = ("mixed_model",)
_FITTED = ("statistic", "df2", "p", "effect_size", "se", "log_likelihood")
_SECOND_FIRST = "second level minus first; ours is first minus second"
_ALONE = (
    "with an intercept for each participant alone, so that rows of one condition count as if independent; ours has the"
    " further ones that its method names"
)
_INFINITE = "as if the number of participants were infinite; ours has Satterthwaite's degrees of freedom"
_MODELS = (
    KnownReason(_OF_MODEL, ("statistic", "effect_size"), _SECOND_FIRST, ways.of_other_sign),
    KnownReason(_OF_MODEL, ("statistic", "df1"), "F with one degree of freedom, the square of t", ways.f_of_t),
    KnownReason(_OF_MODEL, ("statistic",), "Wald's χ², which is F times its degrees of freedom", ways.times("df1")),
    KnownReason(_OF_MODEL, ("p",), f"normal z for t: {_INFINITE}", ways.normal_p),
    KnownReason(_OF_MODEL, ("p",), f"χ² for F: {_INFINITE}", ways.chi2_p),
    KnownReason(
        _OF_MODEL, ("statistic", "df2", "p", "effect_size", "se", "log_likelihood"), _ALONE, ways.participants_alone
    ),
    KnownReason(_OF_MODEL, ("statistic",), f"{_ALONE}; and Wald's χ² for F", ways.chi2_of_participants_alone),
    KnownReason(
        _OF_MODEL,
        _FITTED,
        "its search stopped before the largest likelihood",
        ways.at_lower_likelihood,
    ),
    KnownReason(
        _OF_MODEL,
        ("statistic", "se"),
        "standard error from the joint information of coefficients and variances; ours, as lme4's, takes the variances"
        " as known, which is the same only in balanced data",
        derivatives.of_observed_information,
    ),
    KnownReason(
        _OF_MODEL,
        ("statistic", "df2", "p"),
        "its second derivatives of the likelihood by θ and σ have an eigenvalue that it takes for zero (below 1e-8), as"
        " of variances or units of extreme size; ours come from closed forms",
        derivatives.where_it_is_flat,
    ),
)

_ADJUSTED = (
    KnownReason(
        (P_ADJUSTED,),
        ("p_adjusted",),
        "adjusts the uncorrected p; ours is of the p that is judged by, corrected by Greenhouse and Geisser",
        ways.of_data(conventions.of_uncorrected),
    ),
)

REASONS: Sequence[KnownReason] = (
    *_wilcoxon(as_floats=False, pratt=None),
    *_wilcoxon(as_floats=False, pratt=False),
    *_wilcoxon(as_floats=True, pratt=None),
    *_PAIRED,
    *_FRIEDMAN,
    *_ANALYSES,
    *_GROUPS,
    *_MODELS,
    *_ADJUSTED,
)
"""All of them, in the order in which they are tried."""
