"""Kinds of friction and their constants.

The kernels need numba; they are imported when a law is needed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from tetra_drake.errors import InputError
from tetra_drake.scenario.kind_text import settings_text
from tetra_drake.scenario.quantities import (
    Damping,
    DampingPerLength,
    Force,
    Length,
    Stiffness,
)
from tetra_drake.scenario.refusals import refuse
from tetra_drake.scenario.section import Kinds, Section, Varied
from tetra_drake.scenario.units import INCH, POUND_FORCE

if TYPE_CHECKING:
    from tetra_drake.physics.friction import FrictionLaw


MUJOCO_FRICTION = 0.5
"""Coefficient of MuJoCo's friction in place of the thesis's law; typical of metal on a floor."""


@dataclass(frozen=True)
class Cone:
    """MuJoCo's friction: against the velocity, and at most `coefficient` times the load."""

    coefficient: float
    damping: float
    """Force per velocity below the limit, in N s/m."""


class FrictionKind(Section):
    """Base class of the kinds of friction."""

    modes: ClassVar[str]
    """Meaning of the signs of friction modes in recorded trajectories."""

    def law(self) -> FrictionLaw:
        """The law in the form that the kernels need."""
        raise NotImplementedError

    def without_bristles(self) -> FrictionKind:
        """The same kind as MuJoCo knows it, whose nodes creep in stick."""
        return self

    @property
    def text(self) -> str:
        """Description of the law for pages."""
        raise NotImplementedError

    def cone(self, source: object) -> Cone:
        """MuJoCo's friction for this law. Raises InputError, naming `source` and key, if there is
        none."""
        problem = f"found !{type(self).__name__}, which mujoco cannot simulate"
        raise InputError(source, "friction", problem)

    @property
    def cone_text(self) -> str:
        """Description of MuJoCo's friction for this law."""
        return self.text


class ResetIntegrator(FrictionKind):
    """Friction of the thesis (Table 2, Eq. 3-5), independent of the load.

    A bristle holds a node until it is bent by `stiction_range`. See physics.friction. The keys from
    `stiffness` on are other readings of the thesis's text.
    """

    modes = "0 sticks, +1 or -1 slips in that direction along the tangent"

    stiction_range: Annotated[Length, Varied()] = Field(gt=0)
    """Deflection p0 at which a node breaks free."""
    stiction_damping: Annotated[Damping, Varied()] = Field(ge=0)
    """Friction per velocity while a node sticks, sigma_1."""
    stiction_switch: Annotated[float, Varied()] = Field(ge=0)
    """Share a_c that is added to the bristle's force while a node sticks."""
    proportional_stiction: Annotated[DampingPerLength, Varied()] = Field(ge=0)
    """Friction divided by deflection and by velocity, sigma_0."""
    stiffness: Stiffness = Field(default=0.0, ge=0)
    """Stiffness of the bristle: friction divided by deflection, as sigma_0 in Olsson's model."""
    reset: Literal["reversal", "range", "never"] = "reversal"
    """Where the deflection becomes 0: at `reversal` of the velocity; or at the stiction `range`,
    and the node sticks again at once; or `never`."""
    breaks_free: Literal["each", "both"] = "each"
    """Tangents along which a node breaks free: `each` by itself, or `both` as soon as the
    deflection along one reaches the stiction range."""
    load: Force | None = Field(default=None, gt=0)
    """Normal force at which friction is as given; friction is proportional to the normal force. If
    not given, friction is independent of it."""

    def law(self) -> FrictionLaw:
        from tetra_drake.physics.friction import FrictionLaw, ResetConstants

        return FrictionLaw.of(
            ResetConstants(
                stiction_range=self.stiction_range,
                stiction_damping=self.stiction_damping,
                stiction_switch=self.stiction_switch,
                proportional_stiction=self.proportional_stiction,
                stiffness=self.stiffness,
                kept=1.0 if self.reset == "never" else 0.0,
                restarts=1.0 if self.reset == "range" else 0.0,
                joint=1.0 if self.breaks_free == "both" else 0.0,
                per_load=0.0 if self.load is None else 1.0 / self.load,
            )
        )

    @property
    def text(self) -> str:
        return "the thesis's friction"

    def cone(self, source: object) -> Cone:
        return Cone(MUJOCO_FRICTION, self.stiction_damping)

    @property
    def cone_text(self) -> str:
        return f"MuJoCo's friction (coefficient {MUJOCO_FRICTION:g})"


class Coulomb(FrictionKind):
    """Friction that grows with the load, and may depend on the direction of travel.

    A bristle holds a node until its force exceeds `static` times the load. See physics.friction.
    """

    modes = "0 sticks, else the signs of the direction of slip"

    static: Annotated[float, Varied("coefficients")] = Field(default=0.5, gt=0)
    """Coefficient of friction of nodes that stick."""
    kinetic: Annotated[float, Varied("coefficients")] = Field(default=0.5, gt=0)
    """Coefficient of friction of nodes that slip; at most `static`."""
    stiffness: Stiffness = Field(default=0.0, ge=0)
    """Stiffness of the bristle; 0 lets a robot creep on a slope."""
    damping: Annotated[Damping, Varied()] = Field(default=0.4 * POUND_FORCE / INCH, gt=0)
    """Friction per velocity below the limit."""
    forward: float = Field(default=1.0, gt=0)
    """Factor on the coefficients for slip along the body's heading."""
    backward: float = Field(default=1.0, gt=0)
    """Factor on the coefficients for slip against the body's heading."""
    lateral: float = Field(default=1.0, gt=0)
    """Factor on the coefficients for sideways slip."""

    @model_validator(mode="after")
    def _check(self) -> Coulomb:
        if self.kinetic > self.static:
            refuse("kinetic", f"found {self.kinetic}, expected at most static, {self.static}")
        return self

    def without_bristles(self) -> FrictionKind:
        return self.model_copy(update={"stiffness": 0.0})

    def law(self) -> FrictionLaw:
        from tetra_drake.physics.friction import CoulombConstants, FrictionLaw

        return FrictionLaw.of(
            CoulombConstants(
                static=self.static,
                kinetic=self.kinetic,
                stiffness=self.stiffness,
                damping=self.damping,
                per_forward=1.0 / self.forward,
                per_backward=1.0 / self.backward,
                per_lateral=1.0 / self.lateral,
            )
        )

    @property
    def text(self) -> str:
        return f"Coulomb friction{settings_text(self, always=('static', 'kinetic'))}"

    def cone(self, source: object) -> Cone:
        possible = {"static": self.kinetic, "stiffness": 0.0}
        possible |= {"forward": 1.0, "backward": 1.0, "lateral": 1.0}
        wrong = {key: most for key, most in possible.items() if getattr(self, key) != most}
        if wrong:
            first, units = next(iter(wrong)), {"stiffness": " N/m"}
            changes = [f"{key}: {most:g}{units.get(key, '')}" for key, most in wrong.items()]
            friction = ", ".join(changes)
            found = f"found {getattr(self, first):g}, but mujoco can simulate only {wrong[first]:g}"
            remedy = f"make a scenario with this one as `base` and friction: {{{friction}}}"
            raise InputError(source, f"friction.{first}", f"{found}; {remedy}")
        return Cone(self.kinetic, self.damping)


Friction = Annotated[ResetIntegrator | Coulomb, Kinds()]
"""Union of the kinds of friction. A mapping without a tag is of the first kind."""
