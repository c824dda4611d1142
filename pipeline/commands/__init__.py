"""One module a command, or a family of them: paths, progress, what is printed, and the exit code."""
