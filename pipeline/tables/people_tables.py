"""The tables behind figures of participants: who is in which group, and how normal what is tested of them is."""

from __future__ import annotations

from pipeline.tables.columns import MEASURE, PARTICIPANT, Table, count, number, text

GROUP_MEMBERS = Table(
    "group_members",
    "One row per measure, factor and participant, where groups of participants are compared: who is in which.",
    (
        MEASURE,
        text("factor", "the factor that tells the groups apart"),
        PARTICIPANT,
        text("group", "the participant's level of it"),
    ),
    stages=("compare",),
    as_csv=True,
)

NORMAL_QUANTILES = Table(
    "normal_quantiles",
    "One row per value whose normality a comparison assumes, beside the normal quantile of its rank (Q-Q plots).",
    (
        MEASURE,
        text("test", "the first test that takes these values as normal, as study.yaml names it"),
        text("kind", "what they are: differences, residuals, or a group's own values"),
        text("of", "of which pair of conditions, which effects or terms, which group"),
        count("logarithms", "1 where logarithms are tested, and value is one; else 0"),
        PARTICIPANT,
        text("cell", "of residuals: the condition, or the levels of an effect's factors; null for one of each person"),
        number("value", "difference, residual or the value itself, in the measure's unit"),
        number("standardised", "the same less the mean of all in its sample, over their SD"),
        number("quantile", "the standard normal quantile of the median of its rank"),
        number("band_low", "lower end, there, of the pointwise 95 % band of normal values of this mean and SD"),
        number("band_high", "its upper end"),
        count("outside", "1 where standardised lies outside the band, else 0"),
    ),
    stages=("compare",),
    as_csv=True,
)
