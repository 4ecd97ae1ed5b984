"""Laws of friction for a node on the ground, in the tangent plane of the ground.

The velocity is v, the deflection from the stick point x. The reset integrator (Eq. 3-5) acts along
each tangent independently:

    in stick  F = -(s (1 + a_c) x + sigma_1 v), with s = k + sigma_0 |v|
    in slip   F = -s x, with x constant at p0 or -p0

A node breaks free at |x| >= p0 if it moves outward. It sticks again, with x = 0, when v changes
sign. The thesis's bristle has no stiffness k.

Settings change this law. At p0, x can become 0, and the node sticks again at once. Then x is known
in closed form: the distance from the stick point less whole p0. So no step has to end at a reset;
at its end the stick point moves by whole p0. When v changes sign, x can stay what it is. A node
that breaks free along one tangent can break free along both, and x stays what it is along the
other. F can be proportional to the normal force.

Coulomb friction acts in the plane, regularised by a bristle. The normal force F_N limits it:

    u = c v + k x in stick, c v in slip
    F = -u min(1, mu F_N / s(u)), with mu static in stick and kinetic in slip
    s(u) = sqrt((u_f / a_f)^2 + (u_l / a_l)^2)

The component u_f is along the body's heading at touchdown; a_f is `forward` or `backward`,
depending on the sign of u_f. The component u_l is sideways; a_l is `lateral`. A node breaks free at
s(u) > static F_N if it moves outward. It sticks again, with x = 0, at s(c v) <= kinetic F_N. With k
= 0 and static = kinetic the law has no memory: it is MuJoCo's soft friction.

A node on the ground sticks or slips. Its *mode* is STICK, or the direction of its slip when it
broke free: +1 or -1 along each tangent for the reset integrator, a unit vector for Coulomb
friction. A node that sticks may creep, because its bristle bends. Modes are constant within a step
of an integrator, so forces are smooth there. Modes change at the end of a step. With a law without
stiction, nodes always stick.

Both laws have the same functions of a Slide: force, damping, next mode, and time to the next
change. by_law() chooses between them. A further law needs settings, constants, these functions, and
its line in by_law(). A law of a plug-in has them in a FrictionFunctions.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, cast

import numpy as np
from pydantic import Field, model_validator

from tetra_drake.errors import InputError
from tetra_drake.kernels.compiling import F, inlined
from tetra_drake.kernels.lanes import (
    Real,
    Table,
    Truth,
    any_lane,
    floor,
    maximum,
    minimum,
    named,
    not_,
    select,
)
from tetra_drake.kernels.own import OwnFunctions, with_own
from tetra_drake.settings.quantities import (
    Damping,
    DampingPerLength,
    ForceQuantity,
    Length,
    Stiffness,
)
from tetra_drake.settings.refusals import refuse
from tetra_drake.settings.section import Kinds, Section, Varied, settings_text
from tetra_drake.settings.units import INCH, POUND_FORCE

RESET_INTEGRATOR, COULOMB, OWN = range(3)
"""Numbers of the friction laws in kernels. OWN is a law with a FrictionFunctions."""

STICK = 0.0
"""Friction mode of a node that sticks."""

Vector2 = tuple[Real, Real]
"""Components along the tangents t1 and t2."""

_LITTLE = 0.05
"""Largest share of a bristle in a friction that is nearly viscous."""

MUJOCO_FRICTION = 0.5
"""Coefficient of MuJoCo's friction in place of the thesis's law; typical of metal on a floor."""


@dataclass(frozen=True)
class Cone:
    """Constants of MuJoCo's friction: a force against the velocity of a node, whose size is at most
    `coefficient` times the normal force."""

    coefficient: float
    damping: float
    """Force per velocity below the limit, in N s/m."""


class FrictionKind(Section):
    """Base class for the settings of friction between the nodes and the ground."""

    modes: ClassVar[str]
    """Meaning of the signs of friction modes in recorded trajectories."""
    cone_text: ClassVar[str] = ""
    """Description of the law that MuJoCo uses in place of this one, for pages; empty if it is the
    same."""

    own: ClassVar[FrictionFunctions]
    """Functions of a plug-in's law for the kernels. The laws of this module override law()."""

    def law(self) -> FrictionLaw:
        """The law of friction with these settings as constants, as an argument of kernels."""
        return FrictionLaw(OWN, self.own.table(self), self.own)

    def without_bristles(self) -> FrictionKind:
        """This law with a bristle stiffness of 0, for MuJoCo: nodes that stick creep."""
        return self

    @property
    def is_viscous(self) -> bool:
        """True if friction is nearly proportional to velocity at all times. Then coarse steps
        suffice: they cannot miss the moment when a node begins or ends to slip."""
        return False

    @property
    def text(self) -> str:
        """Description of the law for pages that show a robot or its results, such as "the thesis's
        friction"."""
        return f"{self.tag} friction{settings_text(self)}"

    def cone(self, source: object) -> Cone:
        """MuJoCo's friction in place of this law. Raises InputError, naming `source` (the scenario)
        and the key, if MuJoCo cannot simulate it."""
        problem = f"found !{type(self).__name__}, which mujoco cannot simulate"
        raise InputError(source, "friction", problem)


class FrictionLaw(NamedTuple):
    """Kind and constants of the law of friction between the nodes and the ground, for the
    kernels."""

    kind: int
    """RESET_INTEGRATOR, COULOMB or OWN."""
    constants: Table
    """The fields of ResetConstants or CoulombConstants, or of the constants of `own`, as an
    array."""
    own: FrictionFunctions | None = None
    """Functions of the law OWN."""


class TangentSlide(NamedTuple):
    """Motion of a node along one tangent of the ground, and its friction mode along it: 0 if it
    sticks, otherwise the direction of slip."""

    velocity: Real
    """Velocity in m/s."""
    deflection: Real
    """Distance from the stick point in m."""
    mode: Real


class Slide(NamedTuple):
    """Motion of a node along the ground's tangents t1 and t2, the normal force on it, and the
    heading of its body."""

    t1: TangentSlide
    t2: TangentSlide
    heading: Vector2
    """Direction of the node's body at touchdown, a unit vector."""
    normal: Real
    """Normal force in N."""


class NextMode(NamedTuple):
    """Friction mode of a node after a step, if it stays on the ground: along each tangent 0 if it
    sticks, otherwise the direction of its slip."""

    mode: Vector2
    begins: tuple[Truth, Truth]
    """For each tangent, True if the node begins to stick along it."""
    bend: Vector2
    """Deflection (m) of the bristle along each tangent when the node begins to stick there, or its
    deflection restarts."""


@inlined
def first_zero(value: Real, rate: Real, rate_rate: Real, horizon: Real) -> Real:
    """First time t (s) in (0, horizon) at which value + rate t + rate_rate t²/2 falls to zero.

    `value` has any unit; `rate` and `rate_rate` are its first and second derivative by time.
    Returns the horizon (s) if there is no such time, or if `value` is not positive.
    """
    reach = horizon * (abs(rate) + 0.5 * horizon * abs(rate_rate))
    if not any_lane((value > 0.0) & (value <= reach)):
        return horizon
    discriminant = rate * rate - 2.0 * rate_rate * value
    # Twice the mean speed of the fall to zero.
    speed = math.sqrt(maximum(discriminant, 0.0)) - rate
    falls = (value > 0.0) & (discriminant >= 0.0) & (speed > 0.0)
    return select(falls, minimum(2.0 * value / select(falls, speed, 1.0), horizon), horizon)


# Reset integrator: a law along each tangent.


class ResetIntegrator(FrictionKind):
    """Friction of the thesis (Table 2, Eq. 3-5), independent of the load. A bristle holds a node
    until it is bent by `stiction_range`. See laws.friction. `stiffness`, `reset`, `breaks_free` and
    `load` choose other readings of the thesis's text.
    """

    modes = "0 sticks, +1 or -1 slips in that direction along the tangent"
    cone_text = f"MuJoCo's friction (coefficient {MUJOCO_FRICTION:g})"

    stiction_range: Annotated[Length, Varied()] = Field(gt=0)
    """Deflection p0 at which a node breaks free."""
    stiction_damping: Annotated[Damping, Varied()] = Field(ge=0)
    """Friction per velocity while a node sticks, sigma_1."""
    stiction_switch: Annotated[float, Varied()] = Field(ge=0)
    """Share a_c that is added to the bristle's force while a node sticks."""
    proportional_stiction: Annotated[DampingPerLength, Varied()] = Field(ge=0)
    """Friction divided by deflection and by velocity, sigma_0."""
    stiffness: Stiffness = Field(default=0.0, ge=0)
    """Stiffness of the bristle, sigma_0 in Olsson's model."""
    reset: Literal["range", "reversal", "never"] = "range"
    """Where the deflection becomes 0: at the stiction `range`, and the node sticks again at once;
    at `reversal` of the velocity; or `never`."""
    breaks_free: Literal["each", "both"] = "each"
    """Tangents along which a node breaks free: `each` by itself, or `both` with the first."""
    load: ForceQuantity | None = Field(default=None, gt=0)
    """Normal force for which the other settings hold, if friction is proportional to it."""

    def law(self) -> FrictionLaw:
        same = {name: value for name, value in self if name in ResetConstants._fields}
        constants = ResetConstants(
            **same,
            kept=float(self.reset == "never"),
            restarts=float(self.reset == "range"),
            joint=float(self.breaks_free == "both"),
            per_load=0.0 if self.load is None else 1.0 / self.load,
        )
        return FrictionLaw(RESET_INTEGRATOR, np.array(constants))

    @model_validator(mode="after")
    def _check(self) -> ResetIntegrator:
        if self.breaks_free == "both" and self.reset == "range":
            refuse("breaks_free", "found 'both' with reset 'range', expected 'each'")
        return self

    @property
    def is_viscous(self) -> bool:
        bristle = (1.0 + self.stiction_switch) * self.stiction_range * self.proportional_stiction
        little = self.stiffness == 0.0 and bristle <= _LITTLE * self.stiction_damping
        return self.reset == "range" and little

    @property
    def text(self) -> str:
        return f"the thesis's friction{'' if self.reset == 'range' else f', reset: {self.reset}'}"

    def cone(self, source: object) -> Cone:
        return Cone(MUJOCO_FRICTION, self.stiction_damping)


class ResetConstants(NamedTuple):
    """Constants of the reset integrator (Table 2 of the thesis), the law with which friction comes
    from a bristle; SI units."""

    stiction_range: Real
    stiction_damping: Real
    stiction_switch: Real
    proportional_stiction: Real
    stiffness: Real
    """Stiffness k of the bristle."""
    kept: Real
    """Share of the deflection that remains when a node sticks again: 0 or 1."""
    restarts: Real
    """1 if the deflection becomes 0 at the stiction range and the node sticks, otherwise 0."""
    joint: Real
    """1 if a node breaks free along both tangents, otherwise 0."""
    per_load: Real
    """Factor on the friction per normal force (1/N); 0 if friction is independent of the load."""


@inlined
def reset_force(slide: Slide, law: ResetConstants) -> Vector2:
    """Friction (N) along both tangents by the reset integrator (Eq. 3-5 of the thesis). `slide` is
    the node's motion and normal force."""
    force_1, force_2 = tangent_force(slide.t1, law), tangent_force(slide.t2, law)
    if not any_lane(law.per_load > 0.0):
        return force_1, force_2
    by_load = select(law.per_load > 0.0, law.per_load * slide.normal, 1.0)
    return by_load * force_1, by_load * force_2


@inlined
def tangent_force(slide: TangentSlide, law: ResetConstants) -> Real:
    """Friction (N) of the reset integrator along one tangent, before any factor for the load. In
    slip, the deflection is the stiction range times the mode (+1 or -1)."""
    per_length = law.stiffness + law.proportional_stiction * abs(slide.velocity)
    bristle = per_length * (1.0 + law.stiction_switch) * (slide.deflection - restarted(slide, law))
    stick = -(bristle + law.stiction_damping * slide.velocity)
    slip = -per_length * law.stiction_range * slide.mode
    return select(slide.mode == STICK, stick, slip)


@inlined
def restarted(slide: TangentSlide, law: ResetConstants) -> Real:
    """Part of a deflection (m) that has become 0 at the stiction range: whole ranges, if the
    deflection restarts there; otherwise 0."""
    if not any_lane(law.restarts != 0.0):
        return 0.0 * slide.deflection
    length = law.stiction_range * floor(abs(slide.deflection) / law.stiction_range)
    return law.restarts * select(slide.deflection < 0.0, -length, length)


@inlined
def reset_damping(slide: Slide, time: Real, law: ResetConstants) -> tuple[Real, Real, Real]:
    """Damping matrix of the friction F for an implicit step of length `time` (s): time times a
    damping, so in kg.

    Returns the components 11, 12 and 22, along t1 and t2, of the stiff part of -(time dF/dv + time²
    dF/dx), with the velocity v and the deflection x. For the reset integrator this part is the
    damping and stiffness in stick.
    """
    stiffness = time * law.stiffness * (1.0 + law.stiction_switch)
    by_load = select(law.per_load > 0.0, law.per_load * slide.normal, 1.0)
    damping = time * (law.stiction_damping + stiffness) * by_load
    along_1 = select(slide.t1.mode == STICK, damping, 0.0)
    along_2 = select(slide.t2.mode == STICK, damping, 0.0)
    return along_1, 0.0 * damping, along_2


@inlined
def next_reset_mode(slide: Slide, law: ResetConstants) -> NextMode:
    """Mode of the reset integrator along each tangent after a step: 0 sticks, otherwise the
    direction of slip. `slide` is the node's motion at the end of the step, with the modes of the
    step."""
    breaks_1, breaks_2 = breaks_free(slide.t1, law), breaks_free(slide.t2, law)
    mode_1, begins_1, bend_1 = next_tangent_mode(slide.t1, breaks_1, breaks_2, law)
    mode_2, begins_2, bend_2 = next_tangent_mode(slide.t2, breaks_2, breaks_1, law)
    return NextMode((mode_1, mode_2), (begins_1, begins_2), (bend_1, bend_2))


@inlined
def breaks_free(slide: TangentSlide, law: ResetConstants) -> Truth:
    """True if a node that sticks begins to slip along this tangent: its bristle is bent by the
    stiction range or more, and it moves outward, so that the bend grows. A deflection that restarts
    at the range never lets it slip."""
    forward = (slide.deflection >= law.stiction_range) & (slide.velocity > 0.0)
    backward = (slide.deflection <= -law.stiction_range) & (slide.velocity < 0.0)
    return (slide.mode == STICK) & (forward | backward) & (law.restarts == 0.0)


@inlined
def next_tangent_mode(
    slide: TangentSlide, breaks: Truth, other_breaks: Truth, law: ResetConstants
) -> tuple[Real, Truth, Real]:
    """Mode of the reset integrator along one tangent after a step, whether the node begins to stick
    along it, and the deflection (m) then; see NextMode.

    `breaks` is true if the node breaks free along this tangent: it then slips in the direction of
    its velocity. If it breaks free along the other tangent only, a law with `joint` lets it slip
    here by a share, the deflection along this tangent divided by the stiction range. A slipping
    node sticks again when its velocity changes sign.
    """
    share = 0.0 * law.joint
    if any_lane(law.joint != 0.0):
        per_range = law.joint / law.stiction_range
        share = select(other_breaks, per_range * slide.deflection, 0.0)
    sticks = slide.mode == STICK
    from_stick = select(breaks, select(slide.velocity > 0.0, 1.0, -1.0), share)
    mode = select(sticks, from_stick, slide.mode)
    mode = select(mode * slide.velocity > 0.0, mode, STICK)
    moved = restarted(slide, law)
    begins = (mode == STICK) & (not_(sticks) | (moved != 0.0))
    kept = law.kept * law.stiction_range * slide.mode
    return mode, begins, select(sticks, slide.deflection - moved, kept)


@inlined
def time_to_reset_change(
    slide: Slide, acceleration: Vector2, normal_rate: Real, horizon: Real, law: ResetConstants
) -> Real:
    """Time (s) to the next mode change of the reset integrator along either tangent, at most
    `horizon` (s).

    `acceleration` (m/s²) along t1 and t2 is taken as constant. `normal_rate` is not used: it is an
    argument because the Coulomb law needs it.
    """
    return minimum(
        time_to_tangent_change(slide.t1, acceleration[0], law, horizon),
        time_to_tangent_change(slide.t2, acceleration[1], law, horizon),
    )


@inlined
def time_to_tangent_change(
    slide: TangentSlide, acceleration: Real, law: ResetConstants, horizon: Real
) -> Real:
    """Time (s) to the next mode change of the reset integrator along one tangent, at most `horizon`
    (s). The acceleration (m/s²) along the tangent is taken as constant."""
    velocity = slide.velocity
    stuck = (slide.mode == STICK) & (law.restarts == 0.0)
    # first_zero() ignores a value of 0, so 0 stands for no mode change.
    to_front = select(stuck, law.stiction_range - slide.deflection, 0.0)
    to_back = select(stuck, law.stiction_range + slide.deflection, 0.0)
    to_rest = slide.mode * velocity
    time = first_zero(to_front, -velocity, -acceleration, horizon)
    time = minimum(time, first_zero(to_back, velocity, acceleration, horizon))
    return minimum(time, first_zero(to_rest, slide.mode * acceleration, 0.0, horizon))


# Coulomb friction in the tangent plane.


class Coulomb(FrictionKind):
    """Friction that grows with the load, and may depend on the direction of slip. A bristle holds a
    node until its force exceeds `static` times the load. See laws.friction.
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
    """The factor for slip backward."""
    lateral: float = Field(default=1.0, gt=0)
    """The factor for sideways slip."""

    @model_validator(mode="after")
    def _check(self) -> Coulomb:
        if self.kinetic > self.static:
            refuse("kinetic", f"found {self.kinetic}, expected at most static, {self.static}")
        return self

    def without_bristles(self) -> FrictionKind:
        return self.model_copy(update={"stiffness": 0.0})

    def law(self) -> FrictionLaw:
        same = {name: value for name, value in self if name in CoulombConstants._fields}
        constants = CoulombConstants(
            **same,
            per_forward=1.0 / self.forward,
            per_backward=1.0 / self.backward,
            per_lateral=1.0 / self.lateral,
        )
        return FrictionLaw(COULOMB, np.array(constants))

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


class CoulombConstants(NamedTuple):
    """Constants of Coulomb friction; SI units. `per_forward`, `per_backward` and `per_lateral` are
    the inverse factors on friction against slip in these directions of the robot."""

    static: Real
    kinetic: Real
    stiffness: Real
    """Stiffness of the bristle."""
    damping: Real
    per_forward: Real
    per_backward: Real
    per_lateral: Real


class BristleForce(NamedTuple):
    """Force u of a node's bristle: c v + k x in stick, c v in slip, with the velocity v, the
    deflection x, the damping c and the stiffness k. Friction is -u up to a limit."""

    u_1: Real
    """Component along t1 in N."""
    u_2: Real
    """Component along t2 in N."""
    size: Real
    """Size of u in N; its length if friction is the same in all directions."""
    limit: Real
    """Largest size without slip in N: mu F_N."""
    stuck: Truth


@inlined
def bristle_force(slide: Slide, law: CoulombConstants) -> BristleForce:
    """Force u of a node's bristle, its size, and the limit above which the node slips; see
    BristleForce."""
    stuck = (slide.t1.mode == STICK) & (slide.t2.mode == STICK)
    stiffness = select(stuck, law.stiffness, 0.0)
    u_1 = law.damping * slide.t1.velocity + stiffness * slide.t1.deflection
    u_2 = law.damping * slide.t2.velocity + stiffness * slide.t2.deflection
    size = coulomb_size(u_1, u_2, slide.heading, law)
    limit = select(stuck, law.static, law.kinetic) * slide.normal
    return BristleForce(u_1, u_2, size, limit, stuck)


@inlined
def coulomb_size(u_1: Real, u_2: Real, heading: Vector2, law: CoulombConstants) -> Real:
    """Size (N) of a force (u_1, u_2) along the tangents, weighted by direction. A node slips if it
    exceeds the coefficient of friction times the normal force.

    Forces of the same size lie on an ellipse. Its half-axes are proportional to the directional
    factors: `forward` or `backward` along the heading, depending on the sign, and `lateral` across
    it. `heading` is a unit vector along t1 and t2.
    """
    along = u_1 * heading[0] + u_2 * heading[1]
    across = u_2 * heading[0] - u_1 * heading[1]
    along *= select(along > 0.0, law.per_forward, law.per_backward)
    across *= law.per_lateral
    return math.sqrt(along * along + across * across)


@inlined
def coulomb_force(slide: Slide, law: CoulombConstants) -> Vector2:
    """Coulomb friction (N) along both tangents. It is opposite to the force of the node's bristle,
    and at most the coefficient of friction times the normal force; see BristleForce."""
    bristle = bristle_force(slide, law)
    share = select(bristle.size > bristle.limit, bristle.limit / bristle.size, 1.0)
    return -share * bristle.u_1, -share * bristle.u_2


@inlined
def coulomb_damping(slide: Slide, time: Real, law: CoulombConstants) -> tuple[Real, Real, Real]:
    """Damping matrix of the friction F for an implicit step of length `time` (s): time times a
    damping, so in kg.

    Returns the components 11, 12 and 22, along t1 and t2, of the stiff part of -(time dF/dv + time²
    dF/dx), with the velocity v and the deflection x. Where friction is at its limit, only the
    direction of the force changes. This is exact without directional factors.
    """
    bristle = bristle_force(slide, law)
    stiffness = select(bristle.stuck, time * law.stiffness, 0.0)
    slips = bristle.size > bristle.limit
    rate = time * (law.damping + stiffness) * select(slips, bristle.limit / bristle.size, 1.0)
    u_1, u_2 = bristle.u_1, bristle.u_2
    per_square = select(slips, rate / (u_1 * u_1 + u_2 * u_2), 0.0)
    return rate - per_square * u_1 * u_1, -per_square * u_1 * u_2, rate - per_square * u_2 * u_2


@inlined
def next_coulomb_mode(slide: Slide, law: CoulombConstants) -> NextMode:
    """Mode of Coulomb friction after a step: (0, 0) sticks, otherwise the direction of slip, a unit
    vector along t1 and t2.

    A node breaks free if its bristle's force is beyond the static limit and it moves outward, along
    this force. It sticks again when the bristle's damping alone can hold it.
    """
    bristle = bristle_force(slide, law)
    u_1, u_2 = bristle.u_1, bristle.u_2
    beyond = bristle.size > bristle.limit
    breaks = bristle.stuck & beyond & (u_1 * slide.t1.velocity + u_2 * slide.t2.velocity > 0.0)
    # The two products are kept apart: their sum would be rounded differently in one lane and in
    # several.
    square_1, square_2 = select(breaks, u_1 * u_1, 1.0), select(breaks, u_2 * u_2, 0.0)
    length = math.sqrt(square_1 + square_2)
    mode_1 = select(breaks, u_1 / length, select(beyond, slide.t1.mode, STICK))
    mode_2 = select(breaks, u_2 / length, select(beyond, slide.t2.mode, STICK))
    begins = (mode_1 == STICK) & (mode_2 == STICK) & not_(bristle.stuck)
    return NextMode((mode_1, mode_2), (begins, begins), (0.0 * u_1, 0.0 * u_2))


@inlined
def time_to_coulomb_change(
    slide: Slide, acceleration: Vector2, normal_rate: Real, horizon: Real, law: CoulombConstants
) -> Real:
    """Time (s) until the size of the bristle's force crosses its limit, at most `horizon` (s). Both
    are taken to change at their present rates.

    `acceleration` (m/s²) is along the tangents, `normal_rate` (N/s) is the rate of the normal
    force.
    """
    bristle = bristle_force(slide, law)
    stiffness = select(bristle.stuck, law.stiffness, 0.0)
    rate_1 = law.damping * acceleration[0] + stiffness * slide.t1.velocity
    rate_2 = law.damping * acceleration[1] + stiffness * slide.t2.velocity
    time = 1e-6  # s; for a finite difference
    u_1, u_2 = bristle.u_1 + time * rate_1, bristle.u_2 + time * rate_2
    size_rate = (coulomb_size(u_1, u_2, slide.heading, law) - bristle.size) / time
    limit_rate = select(bristle.stuck, law.static, law.kinetic) * normal_rate
    sign = select(bristle.stuck, 1.0, -1.0)
    reserve, reserve_rate = bristle.limit - bristle.size, limit_rate - size_rate
    return first_zero(sign * reserve, sign * reserve_rate, 0.0, horizon)


# Laws of plug-ins.


@inlined
def always_sticks(slide: Slide, law: Any) -> NextMode:
    """Mode of a law without stiction: the node never begins to slip."""
    zero, never = 0.0 * slide.normal, slide.normal < -math.inf
    return NextMode((zero, zero), (never, never), (zero, zero))


@inlined
def no_change(slide: Slide, acceleration: Vector2, rate: Real, horizon: Real, law: Any) -> Real:
    """Time (s) to the next mode change of a law without stiction: the horizon."""
    return horizon


@dataclass(frozen=True)
class FrictionFunctions(OwnFunctions):
    """Functions of a plug-in's law of friction. The last two have defaults for laws without
    stiction, whose force is a smooth function of velocity and normal force."""

    force: Callable[..., Vector2]
    """Friction (N) along both tangents, like reset_force(); arguments: slide, constants."""
    damping: Callable[..., tuple[Real, Real, Real]]
    """Damping matrix, like reset_damping(); arguments: slide, time (s), constants."""
    next_mode: Callable[..., NextMode] = always_sticks
    """Mode after a step, like next_reset_mode(); arguments: slide, constants."""
    time_to_change: Callable[..., Real] = no_change
    """Time (s) to the next mode change, like time_to_reset_change(); arguments: slide,
    acceleration, rate of the normal force, horizon, constants."""


# Functions of the ground's law: each calls the function of the law that the ground has.


def by_law(name: str, reset: F, coulomb: F) -> F:
    """Combines the functions of all friction laws into one function whose first argument is a
    FrictionLaw.

    It calls the function of this law with the remaining arguments, then the law's constants.
    `reset` is for the reset integrator, `coulomb` for Coulomb friction; `name` is the function's
    name in a FrictionFunctions.
    """

    @inlined
    def shipped(law: Any, *more: Any) -> Any:
        if law.kind == COULOMB:
            return coulomb(*more, named(CoulombConstants, law.constants))
        if law.kind == RESET_INTEGRATOR:
            return reset(*more, named(ResetConstants, law.constants))
        raise ValueError("unknown law of friction")

    return cast(F, with_own(name, shipped))


friction_force = by_law("force", reset_force, coulomb_force)
"""Friction (N) along both tangents on a node that touches the ground; arguments: slide."""

friction_damping = by_law("damping", reset_damping, coulomb_damping)
"""Damping matrix of the friction for an implicit step: components 11, 12 and 22 of the stiff part
of -(time d/dv + time² d/dx); arguments: slide, time (s)."""

next_mode = by_law("next_mode", next_reset_mode, next_coulomb_mode)
"""Friction mode (NextMode) at the end of a step, for a node that stays on the ground; arguments:
slide."""

time_to_friction_change = by_law("time_to_change", time_to_reset_change, time_to_coulomb_change)
"""Time (s) to the next change of the friction mode of a node, at most a horizon; arguments: slide,
acceleration along the tangents, rate of the normal force (N/s), horizon (s)."""


Friction = Annotated[ResetIntegrator | Coulomb, Kinds(FrictionKind)]
"""Settings of friction, of any kind. Without a YAML tag such as !Coulomb they are a
ResetIntegrator."""
