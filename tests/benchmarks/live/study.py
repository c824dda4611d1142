"""The study that is served: a tracker by UDP, a phone that fuses with it, tasks of four minutes that nobody ends."""

from __future__ import annotations

import socket
from pathlib import Path

STUDY = """
title: A long day
data_origin: simulated
conditions: [fusion, again]
participants: participants.csv
sessions: data/{participant}_{condition}.mcap
axes: [x, y]
streams:
  tracker: {topic: /tracker/position, kind: position, latency_s: 0.0, noise_sd_mm: 2, rate_hz: 30}
  imu: {topic: /phone/imu, kind: acceleration, gravity_mm_s2: [0, -9806.65, 0], noise_sd_mm_s2: 100, rate_hz: 100}
  display: {topic: /display/position, kind: display}
events: {topic: /events}
display: {px_per_mm: 10, unit: px}
estimators: {fusion: {type: fusion_kalman}}
shown: {fusion: fusion, again: fusion}
task:
  window_mm: [85.4, 48]
  path_mm: [[-200, 500], [200, 600]]
  targets_mm: [[-100, 500], [0, 560], [150, 600]]
comparisons: [{measure: completion_time_s, test: t_paired}]
recording:
  countdown_s: 0
  abort_after_s: 240
  senders: {tracker: {udp_json: {port: PORT}, unit: m}, imu: {phone: motion}}
"""


def write_study(folder: Path) -> int:
    """Write it; the port that its tracker sends to."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = int(free.getsockname()[1])
    folder.mkdir(parents=True)
    (folder / "study.yaml").write_text(STUDY.replace("PORT", str(port)), encoding="utf-8")
    return port
