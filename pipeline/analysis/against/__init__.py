"""The comparisons of a study as other programs compute them, and why some of their figures are not ours.

`problems` has the arrays behind each row, `in_scipy`, `in_pingouin`, `in_statsmodels` and `in_r` call each program as
its users do, `agreement` holds the figures side by side, and `known_reasons` explains differences: each reason
recomputes the other program's figure in that program's own way (`conventions`), and holds only where it meets it.
"""
