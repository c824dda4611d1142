"""Printed figures held against each other: what rounding leaves open, and what no data can give.

No module here knows a study's data. `rounded` and `finding` are what the checks speak in; `granularity`, `p_values`
and `signed_rank` are the mathematics, on plain numbers; `cells`, `arithmetic`, `recomputed`, `freedom`, `from_means`,
`wilcoxon` and `claims` are the checks, on the models of `pipeline.study.printed`; `audit` runs them all.
"""
