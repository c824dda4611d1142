"""Tests of differences between conditions, one module per family, on arrays of complete participants × conditions.

Every phrase that `status` can hold is listed here, once.
"""

FURTHER_TERMS = "further_terms"
"""The key of `details` that lists the fixed terms of a mixed model beside the condition."""

OK = "ok"
ALL_ZERO = "undefined: all differences are zero"
NO_ERROR = "undefined: all differences are equal, so there is no error to test against"
NO_VARIATION = "undefined: no value varies"
NO_COMPLETE = "undefined: no participant is complete"
ONE_CONDITION_EACH = (
    "undefined: each participant met one condition; write factors: {condition: between} and test: t_welch,"
    " mann_whitney, anova_welch or kruskal"
)
ONE_COMPLETE = "undefined: only one participant is complete"
CONFOUNDED = "undefined: nobody has values in two conditions, so the effect cannot be told from the participants"
ALIASED = "undefined: the terms of the model cannot be told apart in these data"
TOO_FEW_VALUES = "undefined: too few values for the terms of the model"
ONE_ORDER = "undefined: everybody met the conditions in the same order"
TOO_FEW_GROUPS = "undefined: there are fewer than two groups"
EMPTY_GROUP = "undefined: a group has no participant"
ONE_IN_GROUP = "undefined: a group has only one participant"
EQUAL_IN_GROUP = "undefined: all values of one group are equal, so its mean has no standard error"
EQUAL_IN_GROUPS = "undefined: no value varies within its group, so there is no error to test against"
NOT_BINARY = "undefined: there are values other than 0 and 1"
NOT_COUNTS = "undefined: there are values that are no counts, which are whole numbers from 0 on"
NOT_EXPOSED = "undefined: there is an exposure that is not above 0, so there is no rate; correct it, or leave it empty"
ONE_LEVEL = "undefined: a condition has no value"
SEPARATED = (
    "undefined: in one condition all answers are the same, or no event was counted, so its odds or rate has no log"
)
ONE_ITEM = "undefined: a scale of one item has no internal consistency"
TOO_FEW_TRIALS = "undefined: nobody has three trials with a time in one session of the condition"
NO_TOTAL_VARIES = "undefined: the sum of the items is the same for everybody"
NO_RESIDUAL = "undefined: no value varies within its cell, so the model has no residual"
NOT_CONVERGED = "undefined: the fit of the model did not converge"
NOT_POSITIVE = "undefined: a logarithm needs values above zero"
NO_LOGARITHMS = "undefined: transform log needs values above zero; leave it out, or use a rank test"

STATUSES = (
    OK,
    ALL_ZERO,
    NO_ERROR,
    NO_VARIATION,
    NO_COMPLETE,
    ONE_CONDITION_EACH,
    ONE_COMPLETE,
    CONFOUNDED,
    ALIASED,
    TOO_FEW_VALUES,
    ONE_ORDER,
    TOO_FEW_GROUPS,
    EMPTY_GROUP,
    ONE_IN_GROUP,
    EQUAL_IN_GROUP,
    EQUAL_IN_GROUPS,
    NOT_BINARY,
    NOT_COUNTS,
    NOT_EXPOSED,
    ONE_LEVEL,
    SEPARATED,
    ONE_ITEM,
    TOO_FEW_TRIALS,
    NO_TOTAL_VARIES,
    NO_RESIDUAL,
    NOT_CONVERGED,
    NOT_POSITIVE,
    NO_LOGARITHMS,
)

OF_LOGARITHMS = ", of the logarithms"
"""Part of the method of every test of logarithms."""

RATIO = "ratio of geometric means"
"""The effect size of a test of two means of logarithms."""

T = "t"
WILSON = "Wilson"
T_OF_SHARES = "t, cut at 0 and 1"
T_BEYOND = "t, reaching beyond 0 to 1, where all values are"
NONE_OF_ALIKE = "none: all shares are alike"
"""How the interval of a condition's mean is computed, as `statistics.descriptive` explains."""
