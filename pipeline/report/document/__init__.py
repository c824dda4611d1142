"""A report as one model and two renderers: HTML and PDF."""
