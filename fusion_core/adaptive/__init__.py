"""Fusion that finds out what its sensors are like. Theory of operation.

`fusion_kalman` believes what study.yaml says of tracker and phone, and where that is wrong it can only doubt the
accelerometer. This filter (`fusion_adaptive`) estimates, beside the motion, what was seen to go wrong in recordings:

    state (23)     position and velocity of the phone (6); the accelerometer's bias in the body's frame (3), its
                   mounting error (3), an acceleration error in the tracker's frame (3: tilt, gravity), heading and
                   scale (2); the lever arm to the tracked point (3); correlated tracker noise (3)
    scales (4)     the tracker's noise, how far accelerations can be trusted, variance and time of correlated noise: by
                   a bank of small filters, weighed by how well each predicted the positions, forgetting over 10 s
    clock (1)      how much later than its stamp a frame was measured: by small filters that try 21 offsets, for a
                   clock that is steady and for one that wanders

**Two times in one filter.** Positions are late, accelerations prompt. The state therefore stands at the newest position
that was *taken in*, about a latency ago, and is never gone back on; accelerations only pile up in rows:

    rows      . . . . . . . . . . . . . . . . . . . .     one a reading of the phone, in order of measurement
    frames    |     |     |     |                         measured
              taken in          ^state      ^head: the integrals from the state to the newest row
                                                  ^now: what is shown, by a state moved over the head

An acceleration costs one step of an integral, a frame one prediction and one correction over the whole interval since
the frame before. All that the states do to an acceleration is linear (`rows.py`), so the integrals of the readings and
of their derivatives are enough: nothing is gone through again when a mounting error is learned.

**A reading of the phone** becomes a row, unless its orientation is one to which no hand can have turned it
(`believed.py`); it is then as if the phone had been silent. After a longer silence the state goes on from the first row
that speaks again, with the phone where its lever arm has turned it.

**A frame** (`steps.py`): the state is moved to it (`moments.py`); is it a measurement at all (`judged.py`: a held
position, exact zeros, a jump that no hand makes), or has the fusion gone astray?; the bank takes it in and says what
the scales are (`bank.py`); so do the offsets of the clock (`clock.py`, `offset.py`); the state takes it in with these.

**What was shown is scored** (`shown.py`): what the filter had shown for the time of a frame, a latency before that
frame came, is compared with it. That is the error that matters, so it decides between the fusion and what positions
alone would have shown, and it widens the stated SD until it is honest. While the tracker sees nothing there is no
such error; then the place where the hand was last seen keeps what is shown from flying away (`seen.py`).

Invariants. Causal; one `arrive` serves live and replay, so both agree to the last bit; a step's cost does not grow with
the session; the tracker's and the phone's frames may be turned at will. To change: the constants of a file are its own;
a state more needs a place in `layout.py`, its coupling in `rows.py` or `moments.py`, and a prior in `fusion.py`. The
order of steps in a frame matters: the bank must see positions less the lever arm as known *before* the frame, or it
counts the frame twice.
"""
