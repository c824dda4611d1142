"""Guesses how a table is meant: its encoding, separator, decimals, headers and shape.

A guess is never acted on by a report. It is what an error proposes to write into study.yaml, and what `steadyhand new`
writes there, for a person to read and correct.
"""
