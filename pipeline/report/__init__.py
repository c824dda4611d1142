"""From results to pages: sections, figures, words, HTML and PDF."""
