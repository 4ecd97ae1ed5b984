"""Simulation engines that a scenario can choose, with their steps and tolerances."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from tetra_drake.laws.friction import FrictionKind
from tetra_drake.settings.quantities import Speed, Time
from tetra_drake.settings.section import Kinds, Section

SHORTEST_STEP, _LONGEST_STEP = 1e-9, 3e-3
"""Limits (s) of the steps of !Compiled; the upper one is a default."""
LONGEST_LOOK_AHEAD = 2e-5
"""Upper limit (s) of look_ahead(); a longer one costs evaluations."""


class EngineSettings(Section):
    """Base class of the settings of a simulation engine. A scenario chooses the engine by its
    kind."""

    module: ClassVar[str]
    """Module whose ENGINE simulates; see engines.engine."""
    packages: ClassVar[tuple[str, ...]] = ()
    """Packages that only this engine needs."""
    has_cone: ClassVar[bool] = False
    """True if the engine replaces some friction laws by MuJoCo's friction; see
    FrictionKind.cone_text."""
    most_signals: ClassVar[int] = 100_000_000
    """Largest number of values of all signals in one simulation; they need about 3 GB."""


class Drake(EngineSettings):
    """Integration of a Drake diagram with error control.

    The mode of a node is whether it touches the ground, and whether it sticks.
    """

    module: ClassVar[str] = "tetra_drake.engines.drake"
    most_signals: ClassVar[int] = 20_000_000
    scheme: Literal["radau3", "runge_kutta3"] | None = None
    """Implicit (radau3) or explicit (runge_kutta3) integrator. By default radau3 for n up to 12
    bodies; for more runge_kutta3, unless dampers stop the fastest motion at a rate above 14 n² per
    second. Where friction is nearly viscous, steps after a mode change are then explicit, too."""
    accuracy: float | None = Field(default=None, gt=0)
    """Target accuracy per step. By default half the least damping ratio of a cable, anchor or joint
    with the robot's mass, because longer steps of radau3 would damp vibrations: from 2e-5 to 0.005,
    or to 0.01 where friction is nearly viscous, as in the scenario thesis; to a tenth of this for
    robots with joints."""
    max_step: Time | None = Field(default=None, gt=0)
    """Longest step. By default 8 ms, or 12 ms where friction is nearly viscous; less if that ratio
    is below 0.05."""
    mode_changes: Literal["step_end", "witness"] = "step_end"
    """When a node may change its mode: at the end of steps, or where a witness function changes
    sign. `witness` needs short steps."""
    look_ahead: Time | None = Field(default=None, ge=0)
    """Shortest step that ends at a predicted mode change; 0 for none. By default 20 us; 0.3 ms
    where friction is nearly viscous."""


class Compiled(EngineSettings):
    """A Rosenbrock method in machine code, which simulates many gaits side by side."""

    module: ClassVar[str] = "tetra_drake.engines.lanes.batch"
    tolerance: Speed | None = Field(default=None, gt=0)
    """Permitted error per step of the velocity of a body; for rotations, of its strut tips. By
    default 0.1 mm/s; 5 mm/s where friction is nearly viscous, as in the scenario thesis; a tenth
    for robots with joints."""
    max_step: Time | None = Field(default=None, gt=SHORTEST_STEP, le=1)
    """Longest step. If not given, 3 ms; less where damping is light, as for !Drake."""

    def longest_step(self, light: float) -> float:
        """The longest step (s): `max_step`; if not given, the default, or `light` if that is
        less."""
        return self.max_step or min(_LONGEST_STEP, light)

    def tolerance_under(self, friction: FrictionKind, *, is_jointed: bool) -> float:
        """The tolerance in m/s; if not given, the default for this friction, with or without
        joints."""
        usual = 5e-3 if friction.is_viscous else 1e-4
        return self.tolerance or (0.1 * usual if is_jointed else usual)


def look_ahead(tolerance: float) -> float:
    """Time (s) from a predicted change of a node's contact or sticking to the end of the step, for
    a tolerance in m/s: 0.2 s per m/s, from 2e-9 s to 2e-5 s."""
    return min(LONGEST_LOOK_AHEAD, max(2.0 * SHORTEST_STEP, 0.2 * tolerance))


class Mujoco(EngineSettings):
    """MuJoCo with its own contact. Its grounds are planes."""

    module: ClassVar[str] = "tetra_drake.engines.mujoco"
    packages: ClassVar[tuple[str, ...]] = ("mujoco",)
    has_cone: ClassVar[bool] = True
    step: Time = Field(default=0.0625e-3, ge=1e-7, le=1)
    """Time step. One that is too long for springs and dampers fails at once."""


EngineKind = Annotated[Drake | Compiled | Mujoco, Kinds(EngineSettings)]
"""Engine of a scenario, with its settings. A mapping without a tag is a Drake."""
