"""The phone in the hand: its orientation (`orientation`), and how its sensor is mounted on it (`calibration`)."""
