"""Numbers, p values, names and results as people read them. No figure is computed here."""
