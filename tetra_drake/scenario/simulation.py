"""Duration, sampling and limits of a simulation."""

from __future__ import annotations

from pydantic import Field, model_validator

from tetra_drake.settings.quantities import Speed, Time
from tetra_drake.settings.refusals import refuse
from tetra_drake.settings.section import Section

LONGEST_SETTLING = 3.0
"""Upper limit (s) of the default of SimulationSection.steady_from."""


class SimulationSection(Section):
    """Duration and sampling of a simulation, and limits beyond which it fails."""

    duration: Time = Field(gt=0, le=1e5)
    """Simulated time."""
    steady_from: Time | None = Field(default=None, ge=0)
    """Time at which the steady walk begins, for fitness and metrics (section 2.3). By default a
    quarter of the duration, at most 3 s."""
    max_evaluations: int = Field(ge=1)
    """Largest number of evaluations of the derivatives in a simulation."""
    sample_period: Time = Field(gt=0)
    """Time between samples of a recorded trajectory."""
    control_period: Time = Field(default=0.02, gt=0)
    """Time between actions of a controller."""
    max_speed: Speed | None = Field(default=None, gt=0)
    """Speed of a body above which a simulation has diverged. By default more than fall, cables and
    actuators give; at least 10.16 m/s."""

    @property
    def settling_time(self) -> float:
        """Time (s) at which the steady walk begins: `steady_from`, or its default."""
        default = min(LONGEST_SETTLING, self.duration / 4.0)
        return default if self.steady_from is None else self.steady_from

    @model_validator(mode="after")
    def _check(self) -> SimulationSection:
        if self.settling_time >= self.duration:
            problem = f"found {self.steady_from} s, expected less than the duration"
            refuse("steady_from", f"{problem}, {self.duration} s; null is a quarter of it")
        return self
