"""Brings a study's tables up to date: which entries there are, which must be computed, and where."""
