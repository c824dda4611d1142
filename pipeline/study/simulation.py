"""What study.yaml says of a task and of simulated participants; every trait has its source beside it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field, model_validator

from pipeline.study.fields import Finite, Frozen, Positive

NotNegative = Annotated[float, Field(ge=0, le=1e9, allow_inf_nan=False)]
Point = tuple[Finite, Finite]
Extent = tuple[Positive, Positive]


class Ring(Frozen):
    """Targets on a circle, each next to be selected across from the last, as in ISO 9241-411."""

    centre_mm: Point
    diameter_mm: Positive
    targets: Annotated[int, Field(ge=2, le=99)] = 13
    target_diameter_mm: Positive = 20.0


class Task(Frozen):
    """Where the targets are, in the tracker's x and y, and how much of it the display shows.

    `path_mm` leads from target to target; without one a participant goes straight. Without `window_mm` all is in view.
    """

    canvas_x_mm: Point = (-1000.0, 1000.0)
    canvas_y_mm: Point = (0.0, 1000.0)
    window_mm: Extent | None = None
    path_mm: tuple[Point, ...] = ()
    targets_mm: tuple[Point, ...] = ()
    target_diameter_mm: Positive = 20.0
    rings: tuple[Ring, ...] = ()

    @model_validator(mode="after")
    def _fits_together(self) -> Task:
        if bool(self.targets_mm) == bool(self.rings):
            raise ValueError("task: needs either targets_mm or rings")
        if len(self.path_mm) == 1:
            raise ValueError("task: path_mm needs two points or more, or none")
        for name, (low, high) in (("canvas_x_mm", self.canvas_x_mm), ("canvas_y_mm", self.canvas_y_mm)):
            if low >= high:
                raise ValueError(f"task: {name} needs the lower end first, found {[low, high]}")
        for x, y in (*self.path_mm, *self.targets_mm):
            inside = self.canvas_x_mm[0] <= x <= self.canvas_x_mm[1]
            if not (inside and self.canvas_y_mm[0] <= y <= self.canvas_y_mm[1]):
                raise ValueError(f"task: the point {[x, y]} is outside the canvas")
        return self


class Trait(Frozen):
    """A trait's mean over people, how far people differ (coefficient of variation), and who says so."""

    mean: NotNegative
    cv: Annotated[float, Field(ge=0, le=1)] = 0.0
    source: str = Field(min_length=1)


def _trait(mean: float, cv: float, source: str) -> Trait:
    return Trait(mean=mean, cv=cv, source=source)


_KAMP = "van de Kamp et al. 2013, PLoS Comput Biol"
_LAG = "MacKenzie and Ware 1993, pointing under lag; not this study"
_JUDGED = "judgement"


class Traits(Frozen):
    """A simulated participant's perception, movement and decision; the defaults are those of the literature."""

    visual_delay_s: Trait = _trait(0.15, 0.12, f"{_KAMP}: 0.14 s")
    refractory_s: Trait = _trait(0.25, 0.15, f"{_KAMP}: refractory time of a zero-order system")
    base_time_s: Trait = _trait(0.10, 0.2, "square-root form of Gan and Hoffmann 1988")
    time_per_sqrt_mm_s: Trait = _trait(0.03, 0.2, "Fischer et al. 2020: 0.5 s at 200 mm as minimum-jerk fits")
    noise_along_sqrt_s: Trait = _trait(0.0447, 0.25, "Do et al. 2021; Harris and Wolpert 1998")
    noise_across_sqrt_s: Trait = _trait(0.0045, 0.25, "Do et al. 2021; Harris and Wolpert 1998")
    expected_lag_share: Trait = _trait(0.7, 0.143, _LAG)
    dwell_s: Trait = _trait(0.12, 0.4, _LAG)
    press_radius_mm: Trait = _trait(6.0, 0.5, _JUDGED)
    correction_s: Trait = _trait(0.15, 0.0, _JUDGED)
    margin_mm: Trait = _trait(5.0, 0.0, _JUDGED)
    resume_s: Trait = _trait(0.25, 0.0, _JUDGED)
    tap_s: Trait = _trait(0.1, 0.0, _JUDGED)
    patience_s: Trait = _trait(2.0, 0.0, _JUDGED)
    slow_mm_s: Trait = _trait(20.0, 0.0, _JUDGED)
    dead_zone_mm: Trait = _trait(1.0, 0.0, _JUDGED)
    tremor_mm: Trait = _trait(0.1, 0.0, "physiological tremor at 8 Hz: Elble and Koller 1990")
    drift_mm: Trait = _trait(1.0, 0.0, f"{_JUDGED}: an arm held out, 0.3 Hz")
    natural_frequency_rad_s: Trait = _trait(8.0, 0.15, f"{_JUDGED}; form: Müller 2017 (second_order_lag only)")
    damping_ratio: Trait = _trait(0.9, 0.0, f"{_JUDGED}; form: Müller 2017 (second_order_lag only)")


class Instruments(Frozen):
    """How the simulated sensors run; their noise and latency are those that `streams` state."""

    tracker_rate_hz: Positive = 30.0
    imu_rate_hz: Positive = 90.0
    reference_rate_hz: Positive = 90.0
    jitter_sd_s: Annotated[float, Field(ge=0, le=0.1)] = 0.0
    lost: Annotated[float, Field(ge=0, le=0.9)] = 0.0
    imu_bias_sd_mm_s2: NotNegative = 50.0
    held_tilt_sd_deg: Annotated[float, Field(ge=0, le=45)] = 8.0
    wobble_sd_deg: Annotated[float, Field(ge=0, le=45)] = 2.0
    tilt_error_sd_deg: Annotated[float, Field(ge=0, le=45)] = 0.5
    heading_walk_deg_per_sqrt_s: Annotated[float, Field(ge=0, le=45)] = 0.1


class Scale(Frozen):
    """A rating: `base` at the `usual` session, and how much it rises for each doubling of a driver."""

    base: Finite
    per_doubling: Mapping[Literal["completion_time_s", "selection_rmse_mm", "corrections_per_target"], Finite] = {}


class Workload(Frozen):
    """Ratings from a stated response model: judgement, not a finding."""

    questionnaire: str = Field(min_length=1)
    usual: Mapping[Literal["completion_time_s", "selection_rmse_mm", "corrections_per_target"], Positive]
    scales: Annotated[Mapping[str, Scale], Field(min_length=1)]
    person_sd: NotNegative = 15.0
    noise_sd: NotNegative = 8.0
    lowest: Finite = 0.0
    highest: Finite = 100.0
    step: Positive = 5.0

    @model_validator(mode="after")
    def _fits_together(self) -> Workload:
        if self.lowest >= self.highest:
            raise ValueError(f"workload: lowest {self.lowest:g} must be below highest {self.highest:g}")
        for name, scale in self.scales.items():
            for driver in scale.per_doubling:
                if driver not in self.usual:
                    raise ValueError(f"workload: scales.{name} depends on {driver}, for which usual has no value")
        return self


class Published(Frozen):
    """A reduction that a publication reports, from the first condition to the second, to stand beside the simulated."""

    source: str = Field(min_length=1)
    measure: str = Field(min_length=1)
    conditions: tuple[str, str]
    reduction: Annotated[float, Field(ge=-100, le=1)]


class SelectionSimulation(Frozen):
    """The paper's Experiment 2 with simulated participants, who see the display alone."""

    kind: Literal["selection"]
    seed: int
    participants: Annotated[int, Field(ge=1, le=999)]
    model: Literal["intermittent", "second_order_lag"] = "intermittent"
    traits: Traits = Traits()
    instruments: Instruments = Instruments()
    workload: Workload | None = None
    repeats: Annotated[int, Field(ge=0, le=10_000)] = 0
    published: tuple[Published, ...] = ()
    still_before_s: Annotated[float, Field(ge=1, le=60)] = 2.0
    longest_s: Annotated[float, Field(ge=10, le=3600)] = 240.0


class ReachSimulation(Frozen):
    """The paper's Experiment 1: still, a minimum-jerk reach along x, still again."""

    kind: Literal["reach"]
    seed: int
    recordings: Annotated[int, Field(ge=1, le=999)]
    distance_mm: Positive = 200.0
    still_before_s: Annotated[float, Field(ge=0, le=600)] = 2.1
    reach_s: Positive = 0.9
    still_after_s: Annotated[float, Field(ge=0, le=600)] = 2.1
    tracker_rate_hz: Positive = 30.0
    imu_rate_hz: Positive = 90.0
    reference_rate_hz: Positive = 90.0


Simulation = Annotated[ReachSimulation | SelectionSimulation, Field(discriminator="kind")]
