"""Kalman filters: `fusion` of late positions with prompt accelerations, and `position` alone.

`fusion.FusionKalman` runs on one of two paths, each with its compiled steps beside it: `event_time` (any readings, at
the time they were measured; `event_steps` explains how it works) and `fixed_gain` (regular streams). `motion` holds the
priors of the hand's motion, `smoothing` the estimates that use later readings.
"""
