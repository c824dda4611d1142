"""Tests of differences between conditions, one module a family, on complete participants × conditions arrays.

Every phrase that `status` can hold is listed here, once.
"""

OK = "ok"
ALL_ZERO = "undefined: all differences are zero"
NO_ERROR = "undefined: all differences are equal, so there is no error to test against"
NO_VARIATION = "undefined: no value varies"
NO_COMPLETE = "undefined: no participant is complete"
ONE_COMPLETE = "undefined: only one participant is complete"

STATUSES = (OK, ALL_ZERO, NO_ERROR, NO_VARIATION, NO_COMPLETE, ONE_COMPLETE)
