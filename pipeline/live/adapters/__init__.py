"""How bytes come in and go out: one module a transport."""
