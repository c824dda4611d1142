"""`python -m tests.compiled`: compile what the tests use, before each of their processes would do it for itself.

Machine code is kept on the disk, but whoever needs a function that is not there yet compiles it, and the tests'
processes start with the same ones. So some tests that use most of it run once beforehand, each in one process. Once is
enough for a state of the sources: the folder of compiled code, which is of that state alone, then says so.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

from fusion_core import replay_loop
from fusion_core.compilation import code_folder
from pipeline.simulation import hand_steps
from tests.fusion_core import test_conformance, test_likelihood
from tests.fusion_core.accuracy import test_accuracy
from tests.fusion_core.kalman import test_kalman, test_smoothing
from tests.fusion_core.phone import test_orientation
from tests.pipeline.simulation import test_simulation


def main() -> None:
    folder = code_folder(Path(str(hand_steps.__file__)).parent)
    if folder is None or (folder / "tests").exists():
        return
    with ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("spawn")) as pool:
        for future in [pool.submit(piece, *words) for piece, words in PIECES]:
            future.result()
    (folder / "tests").touch()


def estimator(name: str) -> None:
    """All at once, and one reading after the other."""
    built, samples = test_conformance.build(name), test_conformance.recording()
    built.replay(samples, test_conformance.TIMES)
    replay_loop(built, samples, test_conformance.TIMES)


# The longest first, so that none of them is waited for at the end.
PIECES: tuple[tuple[Callable[..., None], tuple[object, ...]], ...] = (
    (estimator, ("fusion_adaptive",)),
    (estimator, ("fusion_kalman",)),
    (test_simulation.test_the_compiled_loop_is_the_plain_one, ("kinect",)),
    (estimator, ("window_gp",)),
    (estimator, ("fusion_kalman, Matérn",)),
    (test_orientation.test_mounting_and_lever_arm_are_found_with_intervals_that_hold_them, ()),
    (test_likelihood.test_the_log_density_is_that_of_each_position_given_those_before, ()),
    (test_orientation.test_the_heading_is_found_from_the_motion, (0.0,)),
    (test_simulation.test_the_compiled_loop_is_the_plain_one, ("fusion",)),
    (test_smoothing.test_a_smoothed_position_is_the_posterior_given_every_reading, ()),
    (estimator, ("position_kalman",)),
    (estimator, ("fusion_kalman, fixed gain",)),
    (test_smoothing.test_waiting_makes_steadier_and_all_readings_steadiest, ()),
    (test_conformance.test_streams_that_are_missing_or_empty_are_no_fault, ("window_gp", ("tracker",), ())),
    (test_smoothing.test_a_fixed_lag_is_the_smoother_on_what_had_arrived, ()),
    (test_accuracy.test_lag_is_found_to_a_fraction_of_a_sample, (0.0,)),
    (test_kalman.test_fusion_is_the_posterior_of_all_readings_whatever_their_order_of_arrival, ()),
    (test_orientation.test_the_heading_reading_by_reading_is_that_of_the_whole_recording, (0.0,)),
    (estimator, ("window_gp, regular",)),
    (test_conformance.test_streams_that_are_missing_or_empty_are_no_fault, ("window_gp, regular", ("tracker",), ())),
)

if __name__ == "__main__":
    main()
