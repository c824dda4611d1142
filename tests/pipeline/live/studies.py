"""A small study to be run live, and what its attempts are made of."""

from __future__ import annotations

from pathlib import Path

from pipeline.live.setup import Setup, set_up
from pipeline.study.folder import load_study
from pipeline.study.settings import Study

STUDY = """
title: Two systems
data_origin: simulated
conditions: [kinect, fusion]
participants: participants.csv
questionnaires: questionnaires.csv
sessions: data/{participant}_{condition}.mcap
axes: [x, y]
streams:
  tracker: {topic: /tracker/position, kind: position, stamp: arrival, latency_s: 0.1, noise_sd_mm: 8, rate_hz: 30}
  imu: {topic: /phone/imu, kind: acceleration, gravity_mm_s2: [0, -9806.65, 0], noise_sd_mm_s2: 100, rate_hz: 90}
  display: {topic: /display/position, kind: display}
events: {topic: /events}
display: {px_per_mm: 10, unit: px}
estimators:
  raw: {type: raw}
  kinect: {type: position_kalman}
  window: {type: window_gp, window: 5}
  fusion: {type: fusion_kalman}
  adaptive: {type: fusion_adaptive}
shown: {kinect: kinect, fusion: fusion}
task:
  window_mm: [85.4, 48]
  path_mm: [[-200, 500], [0, 500], [0, 600], [200, 600]]
  targets_mm: [[-100, 500], [0, 560], [150, 600]]
comparisons: [{measure: completion_time_s, test: t_paired}]
recording:
  countdown_s: 1
  abort_after_s: 30  # simulated people's sensors are prepared until then
  questionnaires: [nasa_tlx]
  senders: {tracker: {demo: {}}, imu: {demo: {}}}
"""


def shown_alone(text: str) -> str:
    """A study that names no estimators but those it shows; a report works out what each would have shown."""
    others = "raw:", "window:", "adaptive:"
    return "\n".join(line for line in text.splitlines() if not line.lstrip().startswith(others))


def brief(text: str) -> str:
    """Such a study with tasks of one target, which simulated people do in 4 s instead of 11 s."""
    return shown_alone(text).replace("[[-100, 500], [0, 560], [150, 600]]", "[[-100, 500]]")


BRIEF = brief(STUDY)


def study_in(folder: Path, text: str = STUDY) -> tuple[Study, Setup]:
    """The study, written into a folder, and set up."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "study.yaml").write_text(text, encoding="utf-8")
    study = load_study(folder, to_be_made=True)
    return study, set_up(study, folder)
