"""A scenario: every number of an experiment, read from a YAML file with units.

The file is text with units ("25 lbf/in"); the dataclasses below hold SI numbers. A field says its
SI unit, its limits and, if a file may leave it out, its default, which means what was before the
field existed.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

from tetra_drake.errors import InputError
from tetra_drake.scenario.fields import (
    Check,
    Tree,
    hint,
    merge,
    quantity,
    refuse,
    setting,
    tree_of,
    tree_of_changes,
    with_values,
)
from tetra_drake.scenario.metric_units import METRICS, inverse
from tetra_drake.scenario.optimizer_kinds import OptimizerKind, SteadyState
from tetra_drake.scenario.terrain_kinds import Flat, Terrain
from tetra_drake.scenario.units import INCH, POUND_FORCE

ENGINES = ("drake", "compiled", "mujoco")
SCHEMES = ("radau3", "runge_kutta3")

CABLES = (
    *("outer bottom_left", "outer bottom_right", "outer top"),
    *("inner bottom_left", "inner bottom_right", "inner top"),
)
"""The cables of a junction, from one tetrahedron to the next: outer ones join base nodes of the
same name, inner ones join the tip to base nodes."""

BALANCED = "balanced"
"""Written as robot.spacing: the spacing at which the cables of a junction balance."""

WHOLE = ("objective", "require")
"""The sections that a file gives as a whole."""

SHORTEST_STEP = 1e-9
"""No step of the engine `compiled` (s) is as short."""

MOST_SIGNALS = {"drake": 20_000_000, "compiled": 100_000_000, "mujoco": 100_000_000}
"""Values of all signals in one simulation, by engine: some 3 GB."""

MOST_SAMPLES = 2_000_000
"""Recorded poses of all tetrahedra in one simulation: some 2 GB."""

TAU_MUTATIONS = ("intended", "listing", "independent")

SIDES = ("left", "right")
"""How the names of cables on one side of the robot end."""

PATHWAYS = ("length", "load", "pitch")
"""What can be fed back to the oscillators; see physics.feedback."""


@dataclass
class RobotScenario:
    """The tetrahedra and where they stand (thesis section 2.1, appendix C.1).

    A `balanced` spacing is the one at which outer and inner cables balance. A file gets it, too,
    if it changes strut length or the cables' stiffness or free length of its base, but no spacing.
    """

    tetrahedra: int = setting(at_least=2, at_most=200)
    strut_length: float = quantity("m", above=0)
    strut_diameter: float = quantity("m", above=0)
    node_diameter: float = quantity("m", above=0)
    density: float = quantity("kg/m^3", above=0)
    spacing: float = quantity("m", above=0, choices=(BALANCED,))  # of base triangles, t = 0
    gravity: float = quantity("m/s^2", at_least=0)
    offsets: list[list[float]] = quantity("m", default=[], length=3)
    """Displacement [x, y, z] of each tetrahedron at t = 0; none if empty."""
    contacts: str = setting(choices=("thesis", "all"), default="thesis")
    """The nodes that the ground can touch: the thesis's, which are the two bottom nodes of every
    tetrahedron and the tip of the first in line, or all four of every tetrahedron. Only flat
    ground leaves the others untouched."""
    actuation: list[list[str]] = setting(choices=CABLES, default=[[CABLES[0], CABLES[1]]])
    """The groups of a junction's cables that share an oscillator, the same for every junction."""

    def check(self, scenario: "Scenario", source: object) -> None:
        """Raises InputError for groups of cables, or offsets, that do not fit the robot."""
        if not self.actuation or not all(self.actuation):
            expected = "groups of at least one cable"
            refuse(source, "robot.actuation", found=self.actuation, expected=expected)
        cables = [cable for group in self.actuation for cable in group]
        for cable in cables:
            if cables.count(cable) > 1:
                expected = "each cable once at most"
                refuse(source, "robot.actuation", found=f"'{cable}' twice", expected=expected)
        count = len(self.offsets)
        if count not in (0, self.tetrahedra):
            expected = f"none or {self.tetrahedra}, one each"
            refuse(source, "robot.offsets", found=f"{count} items", expected=expected)

    def balanced_spacing(self, cables: "CableScenario", source: object) -> float:
        """The spacing at which the cables of a junction balance along x.

        Three outer cables of length s pull two tetrahedra together. Three inner ones, from a tip at
        height h to base nodes at s along and R across, push them apart while s < h.
        """
        height = self.strut_length * math.sqrt(2.0 / 3.0)
        radius = self.strut_length / math.sqrt(3.0)

        def pull(s: float) -> float:
            length = math.hypot(radius, height - s)
            inner = cables.inner_stiffness * (length - cables.free_length) * (height - s) / length
            return cables.outer_stiffness * (s - cables.free_length) - inner

        near, far = 0.0, height + cables.free_length
        if pull(near) >= 0.0:
            raise InputError(source, "robot.spacing", "the cables balance at no spacing; give one")
        while near < (middle := 0.5 * (near + far)) < far:
            near, far = (near, middle) if pull(middle) > 0.0 else (middle, far)
        return far


@dataclass
class GroundScenario:
    """The normal force (Table 1)."""

    stiffness: float = quantity("N/m", above=0)
    damping: float = quantity("N*s/m^2", at_least=0)
    """lambda = 3/2 alpha stiffness, where alpha (s/m) lowers the restitution of an impact at the
    speed v: e = 1 - alpha v (Eq. 2)."""


@dataclass
class ResetIntegrator:
    """The friction of the thesis (Table 2, Eq. 3-5), which does not know the load.

    For each contact and each of two tangents of the ground, with x the deflection from the stick
    point and v the velocity: F = -(sigma_0 |v| (1 + a_c) x + sigma_1 v) in stick and
    F = -sigma_0 |v| x in slip, where x is held at +-p0. A contact breaks free where |x| >= p0
    moving outward, and sticks again, with x = 0, where v changes sign.
    """

    stiction_range: float = quantity("m", above=0)  # p0: deflection at which a node breaks free
    stiction_damping: float = quantity("N*s/m", at_least=0)  # sigma_1
    stiction_switch: float = setting(at_least=0)  # a_c
    proportional_stiction: float = quantity("N*s/m^2", at_least=0)  # sigma_0


@dataclass
class Coulomb:
    """Friction that grows with the load F_N, and may depend on the direction of travel.

    In the tangent plane u = c v + k x, with x the deflection from the stick point (in stick only)
    and v the velocity. F = -u min(1, mu F_N / s(u)), mu static in stick and kinetic in slip, and
    s(u) = sqrt((u_f / a_f)^2 + (u_l / a_l)^2): u_f is along the body's heading at touchdown and
    a_f is `forward` or `backward` by its sign, u_l is sideways and a_l is `lateral`. A contact
    breaks free where s(u) > static F_N moving outward, and sticks again, with x = 0, where
    s(c v) <= kinetic F_N. Without stiffness, and with static = kinetic, the law has no memory: it
    is MuJoCo's soft friction.
    """

    static: float = setting(above=0, default=0.5)  # mu in stick
    kinetic: float = setting(above=0, default=0.5)  # mu in slip; at most `static`
    stiffness: float = quantity("N/m", at_least=0, default=0.0)  # k
    damping: float = quantity("N*s/m", above=0, default=0.4 * POUND_FORCE / INCH)  # c
    forward: float = setting(above=0, default=1.0)  # factors on mu by the direction of slip
    backward: float = setting(above=0, default=1.0)
    lateral: float = setting(above=0, default=1.0)

    def check(self, scenario: "Scenario", source: object) -> None:
        """Raises InputError if a contact in slip had more friction than one in stick."""
        if self.kinetic > self.static:
            expected = f"at most static, {self.static}"
            refuse(source, "friction.kinetic", found=self.kinetic, expected=expected)


Friction = ResetIntegrator | Coulomb
"""What `friction` may be; without a tag it is the first."""


@dataclass
class CableScenario:
    """The tension members (Table 3). A slack cable has tension 0 where it would push."""

    outer_stiffness: float = quantity("N/m", above=0)
    inner_stiffness: float = quantity("N/m", above=0)
    damping: float = quantity("N*s/m", at_least=0)
    free_length: float = quantity("m", at_least=0)
    slack: bool = setting()


@dataclass
class CpgScenario:
    """The Matsuoka oscillators (Table 4) and how their signal reaches the cables.

    `signals`: the thesis's own `listing`, by forward Euler; `recorded`: the network integrated
    beforehand by a Runge-Kutta method of order 4; both in steps of `listing_step`. `live`: the
    network integrated with the robot, which feedback needs.
    """

    self_inhibition_weight: float = setting(at_least=0)  # beta
    external_input: float = setting()  # u0
    initial_state: list[float] = setting(length=3)
    """At t = 0: u of every neuron, v of the extensors, v of the flexors."""
    partner_weight: float = setting(at_least=0)  # between extensor and flexor of an oscillator
    gain: float = quantity("N")  # force per unit of y_extensor - y_flexor
    start_up: float = quantity("s", at_least=0)  # until then the cables are not actuated
    signals: str = setting(choices=("listing", "recorded", "live"))
    listing_step: float = quantity("s", at_least=1e-6)
    reach: int | None = setting(at_least=0, default=None)
    """Oscillators of junctions at most so far apart inhibit each other; all if not given."""
    feedback: list[str] = setting(choices=PATHWAYS, default=[])
    """What is fed back, by gains that are parameters of the gait."""

    def check(self, scenario: "Scenario", source: object) -> None:
        """Raises InputError for a step that does not fit the duration, and for feedback that
        cannot be."""
        step, duration = self.listing_step, scenario.simulation.duration
        if step > duration:
            expected = f"at most the duration, {duration} s"
            refuse(source, "cpg.listing_step", found=f"{step} s", expected=expected)
        check_memory(source, "cpg.listing_step", step, least=scenario.least_signal_period)
        if self.feedback and self.signals != "live":
            expected = f"'live' for feedback of {self.feedback}"
            refuse(source, "cpg.signals", found=f"'{self.signals}'", expected=expected)
        if "load" in self.feedback and scenario.robot.gravity == 0.0:
            expected = "a weight, for feedback of the load"
            refuse(source, "robot.gravity", found="0 m/s^2", expected=expected)


@dataclass
class GaitBoundsScenario:
    """Where random gaits are drawn from (Table 5). Equal bounds fix a parameter."""

    weight_min: float = setting(at_least=0)
    weight_max: float = setting(at_least=0)
    tau_a_min: float = quantity("s", above=0)
    tau_a_max: float = quantity("s", above=0)
    turn: float = setting(at_least=-1, at_most=1, default=0.0)
    """The turn of all gaits that are drawn or evolved."""
    mirrored: bool = setting(default=False)
    """Whether weights are drawn and evolved in pairs, left and right alike."""

    def check(self, scenario: "Scenario", source: object) -> None:
        """Raises InputError for empty ranges, and for what the robot's actuation cannot have."""
        for name in ("weight", "tau_a"):
            low, high = getattr(self, f"{name}_min"), getattr(self, f"{name}_max")
            if low > high:
                expected = f"at most {name}_max, {high}"
                refuse(source, f"gait_bounds.{name}_min", found=low, expected=expected)
        groups = scenario.robot.actuation
        sided = any(all(cable.endswith(side) for cable in g) for g in groups for side in SIDES)
        if self.turn and not sided:
            expected = "0, as no group is on one side"
            refuse(source, "gait_bounds.turn", found=self.turn, expected=expected)
        if not self.mirrored:
            return
        for group in groups:
            if set(mirrored(group)) not in map(set, groups):
                expected = f"false, as {group} has no mirror image"
                refuse(source, "gait_bounds.mirrored", found="true", expected=expected)


@dataclass
class SimulationScenario:
    """How long to simulate, on which engine, how finely, and when to give up.

    From `scheme` to `look_ahead`, the settings are those of the engine `drake`. Contact and
    stiction (modes) change at the end of steps, or are localised by a witness function.
    """

    engine: str = setting(choices=ENGINES)
    duration: float = quantity("s", above=0, at_most=1e5)
    steady_from: float = quantity("s", at_least=0)  # the fitness counts from here (section 2.3)
    scheme: str = setting(choices=SCHEMES)
    accuracy: float = setting(above=0)  # per step
    max_step: float = quantity("s", above=0)
    mode_changes: str = setting(choices=("step_end", "witness"))
    look_ahead: float = quantity("s", at_least=0)
    """With step_end and radau3: shortest step that ends at a predicted mode change; 0 for none."""
    max_evaluations: int = setting(at_least=1)  # of the derivatives, in one simulation
    sample_period: float = quantity("s", above=0)  # of a recorded trajectory

    def check(self, scenario: "Scenario", source: object) -> None:
        """Raises InputError for a steady stretch without length, or too many samples."""
        start, end = self.steady_from, self.duration
        if start >= end:
            expected = f"less than the duration, {end} s"
            refuse(source, "simulation.steady_from", found=f"{start} s", expected=expected)
        least = end * scenario.robot.tetrahedra / MOST_SAMPLES
        check_memory(source, "simulation.sample_period", self.sample_period, least=least)


@dataclass
class CompiledScenario:
    """How finely the engine `compiled` simulates."""

    tolerance: float = quantity("m/s", above=0)
    """Error of a body's velocity, or of its strut tips' by rotation, allowed per step."""
    max_step: float = quantity("s", above=SHORTEST_STEP, at_most=1)
    look_ahead: float = quantity("s", above=SHORTEST_STEP, at_most=1)
    """Time from a predicted mode change to the end of the step that aims at it."""


@dataclass
class MujocoScenario:
    """How the engine `mujoco` simulates, and its friction, which is not that of Table 2."""

    step: float = quantity("s", at_least=1e-7, at_most=1, default=0.125e-3)
    friction: float = setting(above=0, default=0.5)  # coefficient, as of metal on a floor

    def check(self, scenario: "Scenario", source: object) -> None:
        """Raises InputError for steps that do not fit in memory."""
        if scenario.simulation.engine == "mujoco":
            check_memory(source, "mujoco.step", self.step, least=scenario.least_signal_period)


@dataclass
class DisturbancesScenario:
    """The changes of robot and surroundings among which evolution looks for gaits.

    Every gait is simulated once for each of `draws` draws; those of an iteration are the same for
    all its gaits.
    """

    draws: int = setting(at_least=1, at_most=10_000)
    spreads: dict[str, float] = setting(above=0, at_most=0.5, default={})
    """By scenario keys: each draw multiplies the number by 1 + up to +-spread, uniformly. Keys
    joined by commas get the same factor."""
    start: float = setting(at_least=0, at_most=0.5, default=0.0)
    """Each draw displaces every tetrahedron at t = 0 by up to this share of the spacing, forward or
    back, sideways, and up."""
    terrain: bool = setting(default=False)
    """Whether each draw has another seed of the terrain."""
    tail: float = setting(above=0, at_most=1, default=1.0)
    """The fitness is the mean over this share of the draws, the worst (the conditional value at
    risk): 1 is the mean over all; one draw counts at least."""

    def check(self, scenario: "Scenario", source: object) -> None:
        """Raises InputError for a number that a draw cannot change, or not that far."""
        if self.terrain and not hasattr(scenario.terrain, "seed"):
            expected = f"false: !{type(scenario.terrain).__name__} has no seed"
            refuse(source, "disturbances.terrain", found="true", expected=expected)
        undisturbed = tree_of(scenario) | {"disturbances": None}
        for joined, spread in self.spreads.items():
            key = f"disturbances.spreads.{joined}"
            numbers = {name: _number(scenario, name, key, source) for name in separate(joined)}
            for factor in (1.0 - spread, 1.0 + spread):
                changed = {name: factor * number for name, number in numbers.items()}
                try:
                    Scenario.from_tree(with_values(undisturbed, changed), source)
                except InputError as error:
                    problem = f"{spread:g} leads to a wrong {error.key}: {error.problem}"
                    raise InputError(source, key, problem) from error


@dataclass
class EvolutionScenario:
    """The evolutionary algorithm (Table 6, section 2.3, appendix A).

    It stops when the mean fitness rose by less than `stop_rise` over `stop_window` iterations, not
    before iteration `stop_after`.
    """

    population: int = setting(at_least=2, at_most=100_000)
    tournament: int = setting(at_least=1, at_most=100_000)
    trials: int = setting(at_least=1, at_most=1000)
    evaluations: int = setting(at_least=1)
    """Of a trial that does not end early, by any optimiser. !SteadyState makes one for each member
    of the population, then two in each iteration."""
    crossover_probability: float = setting(at_least=0, at_most=1)
    mutation_probability: float = setting(at_least=0, at_most=1)
    weight_mutation: float = setting(at_least=0)  # largest change of a weight in one mutation
    tau_mutation_range: float = quantity("s", at_least=0)  # largest change of tau_A
    tau_mutation: str = setting(choices=TAU_MUTATIONS)
    """`intended`: tau_A mutates, and tau_B stays 2 tau_A. `listing`: as in the thesis's listing,
    neither does. `independent`: both do, and every optimiser varies tau_B by itself."""
    stop_rise: float = setting(at_least=0)
    stop_window: int = setting(at_least=1)
    stop_after: int = setting(at_least=0)
    time_budget: float = quantity("s", above=0)  # wall time; a longer simulation counts as failed


@dataclass(kw_only=True)
class Scenario:
    """Everything that defines an experiment but the gait; all numbers in SI units."""

    name: str = setting()
    robot: RobotScenario
    ground: GroundScenario
    friction: Friction
    terrain: Terrain = setting(default=Flat())
    cables: CableScenario
    cpg: CpgScenario
    gait_bounds: GaitBoundsScenario
    simulation: SimulationScenario
    compiled: CompiledScenario
    mujoco: MujocoScenario = setting(default=MujocoScenario())
    objective: dict[str, float] = setting(units={k: inverse(u) for k, u in METRICS.items()})
    """What evolution maximises: the sum of metrics times these weights, such as `speed: 2 s/in`.
    Lengths count in inches. A file replaces its base's objective as a whole."""
    require: dict[str, float] = setting(units=METRICS, default={})
    """The least values of metrics: a gait with less counts as failed. Replaced as a whole."""
    disturbances: DisturbancesScenario | None = setting(default=None)
    evolution: EvolutionScenario
    optimizer: OptimizerKind = setting(default=SteadyState())

    @property
    def oscillators(self) -> int:
        """One neural oscillator for each group of cables of each junction between tetrahedra."""
        return len(self.robot.actuation) * (self.robot.tetrahedra - 1)

    @property
    def least_signal_period(self) -> float:
        """Time between values of the signals (s) below which they would not fit in memory."""
        return self.simulation.duration * self.oscillators / MOST_SIGNALS[self.simulation.engine]

    @property
    def draws(self) -> int:
        """Simulations of a gait in evolution: one, or one for each draw of disturbances."""
        return self.disturbances.draws if self.disturbances else 1

    def with_changes(self, changes: Mapping[str, Any]) -> Self:
        """A checked copy with other values: {"robot.tetrahedra": 7, "cables.damping": "8 N*s/m"}.

        The same rules hold as in a file that is based on this scenario: quantities have units,
        mappings are merged, and the spacing follows what is changed. Dataclasses, whose numbers are
        SI, replace their section or kind as a whole: {"friction": Coulomb()}. Raises InputError,
        naming the key.
        """
        source, base = f"scenario {self.name}", tree_of(self)
        given: Tree = Check(source).value(type(self), tree_of_changes(changes, base, source))
        for section in WHOLE:
            if section in given and section not in changes:  # as {"objective.lead": "2 /in"}
                given[section] = base[section] | given[section]
        return self.from_tree(on_base(base, given), source)

    @classmethod
    def from_tree(cls, tree: dict[str, Any], source: object) -> Self:
        """The scenario of an SI tree; raises InputError that names `source` and key."""
        scenario: Self = Check(source, complete=True).value(cls, tree)
        if scenario.robot.spacing == BALANCED:
            scenario.robot.spacing = scenario.robot.balanced_spacing(scenario.cables, source)
        if not scenario.objective:
            raise InputError(source, "objective", "found no metric, expected one at least")
        for section in vars(scenario).values():
            if hasattr(section, "check"):
                section.check(scenario, source)
        return scenario


def on_base(base: Tree, given: Tree) -> Tree:
    """The tree of a base with what a file gives, which may decide on the spacing.

    Masses do not count for the balance: twice the density moves T1 by less than 0.003 in.
    """

    def decisive(tree: Tree) -> list[Any]:
        names = ("strut_length", "outer_stiffness", "inner_stiffness", "free_length")
        values = tree.get("robot", {}) | tree.get("cables", {})
        return [values.get(name) for name in names]

    tree: Tree = merge(base, given) | {k: given[k] for k in WHOLE if k in given}
    if "spacing" not in given.get("robot", {}) and decisive(tree) != decisive(base):
        tree["robot"] = tree.get("robot", {}) | {"spacing": BALANCED}
    return tree


def check_memory(source: object, key: str, period: float, *, least: float) -> None:
    """Raises InputError if a period (s) makes more values than memory holds."""
    if period < least:
        expected = f"at least {least:.3g} s for this duration and robot, to fit in memory"
        refuse(source, key, found=f"{period} s", expected=expected)


def separate(joined: str) -> list[str]:
    """The scenario keys that a key of `disturbances.spreads` joins by commas."""
    return [key.strip() for key in joined.split(",")]


def _number(scenario: Scenario, name: str, key: str, source: object) -> float:
    """The number at a dotted key, which `disturbances` changes at `key`."""
    numbers = {
        f"{section}.{field}": value
        for section, settings in vars(scenario).items()
        if dataclasses.is_dataclass(settings)
        for field, value in vars(settings).items()
        if type(value) is float
    }
    if name not in numbers:
        problem = f"'{name}' is no number of the scenario; {hint(name, numbers)}"
        raise InputError(source, key, problem)
    return numbers[name]


def mirrored(cables: Sequence[str]) -> list[str]:
    """The cables of a junction on the other side of the robot, by their names in CABLES."""
    swap = dict(zip(SIDES, reversed(SIDES), strict=True))
    return ["_".join(swap.get(part, part) for part in cable.split("_")) for cable in cables]
