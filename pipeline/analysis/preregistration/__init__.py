"""What was preregistered beside what was done, and whether that is as planned."""
