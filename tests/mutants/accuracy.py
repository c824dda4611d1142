"""Faults in how an estimate is held against a reference, and in what is said of a sensor's noise."""

from __future__ import annotations

from tests.fusion_core.accuracy import test_accuracy, test_not_claimed, test_stretches
from tests.mutants.mutant import Mutant
from tests.pipeline.sessions import test_hand_paths, test_movements

_ACCURACY = (test_accuracy, test_not_claimed, test_stretches)
_MOVEMENTS = (test_hand_paths, test_movements)

MUTANTS = (
    # The reference between its readings.
    Mutant("GAP_S = 0.05  #", "GAP_S = 0.15  #", _ACCURACY),
    Mutant("result[in_gap & ~on_sample] = np.nan", "result[in_gap] = np.nan", _ACCURACY),
    Mutant("value[:, axis], left=np.nan, right=np.nan)", "value[:, axis])", _ACCURACY),
    # Error, stated SD, coverage.
    Mutant("np.sum((estimate - reference) ** 2, axis=1)", "np.mean((estimate - reference) ** 2, axis=1)", _ACCURACY),
    Mutant("np.sqrt(np.mean(np.sum(sd**2, axis=1)))", "np.mean(np.sqrt(np.sum(sd**2, axis=1)))", _ACCURACY),
    Mutant("np.abs(estimate - reference) <= 1.96 * sd", "np.abs(estimate - reference) <= 1.645 * sd", _ACCURACY),
    # The lag.
    Mutant("time[-1] - time[0] < 1.0", "time[-1] - time[0] < 0.0", _ACCURACY),
    Mutant("_BLOCK_S = 0.5  #", "_BLOCK_S = 0.05  #", _ACCURACY),
    Mutant("not 0 < whole < len(shifts) - 1", "not 0 <= whole <= len(shifts) - 1", _ACCURACY),
    Mutant("if scale - blocks.total.min() <= _FLAT * scale or", "if", _ACCURACY),
    Mutant("np.percentile(resampled, [2.5, 97.5])", "np.percentile(resampled, [5, 95])", _ACCURACY),
    Mutant("np.searchsorted(known, time[part] - LAG_RANGE_S", "np.searchsorted(known, time[part]", _ACCURACY),
    Mutant("inside & (gaps[begin] == gaps[np.minimum(end, len(known) - 1)])", "inside", _ACCURACY),
    Mutant("inside = (begin >= 0) & (end < len(known))", "inside = begin >= 0", _ACCURACY),
    Mutant("running[shift] += newest[shift] - oldest[shift]", "running[shift] += newest[shift]", _ACCURACY),
    Mutant("(before - after) / (2.0 * bend)", "(after - before) / (2.0 * bend)", _ACCURACY),
    Mutant("(before - after) / (2.0 * bend)", "(before - after) / bend", _ACCURACY),
    Mutant("if bound[group] <= least + _ROUND_OFF * scale:", "if bound[group] <= 0.8 * least:", _ACCURACY),
    Mutant("for group in ((at - 1) // _GROUP, (at + 1) // _GROUP):", "for group in ((at - 1) // _GROUP,):", _ACCURACY),
    Mutant("_STILL = 1e-6  #", "_STILL = 0.9  #", _ACCURACY),
    # The lead by cross-correlation.
    Mutant("means, shifts) / (n - np.abs(shifts))", "means, shifts) / n", _ACCURACY),
    Mutant("np.conj(a, out=a)", "np.conj(a)", _ACCURACY),
    Mutant("self.value[rows, axis] - mean", "self.value[rows, axis]", _ACCURACY),
    Mutant("2 * len(first.at) - 1, real=True", "len(first.at), real=True", _ACCURACY),
    Mutant("_newest(tracker.arrival, grid)", "_newest(tracker.time, grid)", _ACCURACY),
    Mutant("peak in (0, int(inside.sum()) - 1)", "peak in (-1,)", _ACCURACY),
    Mutant("or not correlation[inside][peak] > 0", "", _ACCURACY),
    Mutant("end - begin < 2 * LAG_RANGE_S", "end - begin < 0", _ACCURACY),
    # Stretches and jitter.
    Mutant("axis=1) / GAP_S < speed_limit_mm_s", "axis=1) < speed_limit_mm_s", _ACCURACY),
    Mutant("~holds[1:] | ~holds[:-1] | (np.diff(time) > GAP_S)", "~holds[1:] | ~holds[:-1]", _ACCURACY),
    Mutant("time[last] - time[first] >= shortest_s", "time[last] - time[first] >= 0", _ACCURACY),
    Mutant("freedom += len(inside) - 1", "freedom += len(inside)", _ACCURACY),
    Mutant("np.sum((inside - inside.mean(axis=0)) ** 2)", "np.sum((inside - inside.mean()) ** 2)", _ACCURACY),
    # A sensor's noise.
    Mutant("np.sqrt(len(value) / (len(value) - 3))", "np.sqrt(len(value) / (len(value) - 1))", _ACCURACY),
    Mutant("_EDGE_S = 0.1  #", "_EDGE_S = 0.0  #", _ACCURACY),
    Mutant("np.ones_like(unit), unit, unit**2]", "np.ones_like(unit), unit]", _ACCURACY),
    Mutant("if len(value) < 10:", "if len(value) < 11:", _ACCURACY),
    Mutant("spread < 2 * np.percentile(spread, 5)", "spread < 50 * np.percentile(spread, 5)", _ACCURACY),
    Mutant("key=lambda stretch: stretch[1] - stretch[0]", "key=lambda stretch: stretch[0]", _ACCURACY),
    Mutant("- first[:-span]) / span", "- first[:-span]) / (span - 1)", _ACCURACY),
    Mutant("middle = time[span // 2 : span // 2 + len(spread)]", "middle = time[: len(spread)]", _ACCURACY),
    # How people moved.
    Mutant("_PROMINENCE_MIN = 0.1  #", "_PROMINENCE_MIN = 0.05  #", _MOVEMENTS),
    Mutant("float(np.std(deviations, ddof=1))", "float(np.std(deviations))", _MOVEMENTS),
    Mutant("return max(0, len(peaks) - 1)", "return len(peaks)", _MOVEMENTS),
)
