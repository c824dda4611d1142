"""Simulated recordings with known truth, written as ordinary study files. Everything after is the ordinary path."""
