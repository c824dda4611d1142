"""The tables every stage speaks, and results.json."""
