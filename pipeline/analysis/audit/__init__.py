"""Checks printed figures against each other: which follow within rounding, and which no data can have.

Only `beside_computed` knows a study's data. `finding` is what every check returns and `phrases` writes printed tests as
text; `granularity`, `p_values` and `signed_rank` are the mathematics, on plain numbers; `audit` runs all the other
modules, which are the checks, on the models of `pipeline.study.printed`.
"""
