"""The phone in the hand: how it is turned (`orientation`), and how its sensor sits on it (`calibration`)."""
