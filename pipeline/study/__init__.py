"""A study as its user gives it: settings, tables, printed figures; read and checked."""
