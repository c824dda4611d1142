"""Which values go into which test, and what the design allows."""
