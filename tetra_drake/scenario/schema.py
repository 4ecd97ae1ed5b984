"""A scenario: every number of an experiment, read from a YAML file with units.

The file is text with units ("25 lbf/in"); the dataclasses below hold SI numbers. A field says its
SI unit, its limits and, if a file may leave it out, its default, which means what was before the
field existed.
"""

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

from tetra_drake.errors import InputError
from tetra_drake.scenario import rules
from tetra_drake.scenario.fields import (
    Check,
    Tree,
    hint,
    quantity,
    setting,
    tree_of,
    tree_of_changes,
    with_values,
)
from tetra_drake.scenario.metric_units import METRICS, inverse
from tetra_drake.scenario.optimizer_kinds import OptimizerKind, QualityDiversity, SteadyState
from tetra_drake.scenario.terrain_kinds import Flat, Terrain
from tetra_drake.scenario.units import INCH, POUND_FORCE

ENGINES = ("drake", "compiled", "mujoco")
SCHEMES = ("radau3", "runge_kutta3")
MUJOCO_INTEGRATORS = ("Euler", "implicit", "implicitfast", "discrete")

CABLES = (
    *("outer bottom_left", "outer bottom_right", "outer top"),
    *("inner bottom_left", "inner bottom_right", "inner top"),
)
"""The cables of a junction, from one tetrahedron to the next: outer ones join base nodes of the
same name, inner ones join the tip to base nodes."""

SHORTEST_STEP = 1e-9
"""No step of the engine `compiled` (s) is as short."""

MOST_SIGNALS = {"drake": 20_000_000, "compiled": 100_000_000, "mujoco": 100_000_000}
"""Values of all signals in one simulation, by engine: some 3 GB."""

MOST_SAMPLES = 2_000_000
"""Recorded poses of all tetrahedra in one simulation: some 2 GB."""

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
    spacing: float = quantity("m", above=0, choices=(rules.BALANCED,))  # of base triangles, t = 0
    gravity: float = quantity("m/s^2", at_least=0)
    offsets: list[list[float]] = quantity("m", default=[], length=3)
    """Displacement [x, y, z] of each tetrahedron at t = 0; none if empty."""
    contacts: str = setting(choices=("thesis", "all"), default="thesis")
    """The nodes that the ground can touch: the thesis's, which are the two bottom nodes of every
    tetrahedron and the tip of the first in line, or all four of every tetrahedron. Only flat
    ground leaves the others untouched."""
    actuation: list[list[str]] = setting(choices=CABLES, default=[[CABLES[0], CABLES[1]]])
    """The groups of a junction's cables that share an oscillator, the same for every junction."""


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

    `signals`: the thesis's own `listing`, the network integrated beforehand by forward Euler in
    steps of `listing_step`; `live`: the network integrated with the robot, which feedback needs.
    """

    self_inhibition_weight: float = setting(at_least=0)  # beta
    external_input: float = setting()  # u0
    inner_state: float = setting()  # u of every neuron at t = 0
    extensor_self_inhibition: float = setting()  # v at t = 0
    flexor_self_inhibition: float = setting()  # v at t = 0
    partner_weight: float = setting(at_least=0)  # between extensor and flexor of an oscillator
    gain: float = quantity("N")  # force per unit of y_extensor - y_flexor
    start_up: float = quantity("s", at_least=0)  # until then the cables are not actuated
    signals: str = setting(choices=("listing", "live"))
    listing_step: float = quantity("s", at_least=1e-6)
    reach: int | None = setting(at_least=0, default=None)
    """Oscillators of junctions at most so far apart inhibit each other; all if not given."""
    feedback: list[str] = setting(choices=PATHWAYS, default=[])
    """What is fed back, by gains that are parameters of the gait."""


@dataclass
class GaitBoundsScenario:
    """Where random gaits are drawn from (Table 5). Equal bounds fix a parameter."""

    weight_min: float = setting(at_least=0)
    weight_max: float = setting(at_least=0)
    tau_a_min: float = quantity("s", above=0)
    tau_a_max: float = quantity("s", above=0)
    gain_min: float = setting(default=-1.0)  # of the scenario's feedback
    gain_max: float = setting(default=1.0)
    turn: float = setting(at_least=-1, at_most=1, default=0.0)
    """The turn of all gaits that are drawn or evolved."""
    mirrored: bool = setting(default=False)
    """Whether weights are drawn and evolved in pairs, left and right alike."""


@dataclass
class SimulationScenario:
    """How long to simulate, on which engine, how finely, and when to give up.

    From `scheme` to `witness_window`, the settings are those of the engine `drake`. Contact and
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
    witness_window: float = quantity("s", above=0)  # how closely a witness localises
    max_evaluations: int = setting(at_least=1)  # of the derivatives, in one simulation
    max_speed: float = quantity("m/s", above=0)  # a faster body counts as diverged
    sample_period: float = quantity("s", above=0)  # of a recorded trajectory


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

    integrator: str = setting(choices=MUJOCO_INTEGRATORS, default="implicitfast")
    step: float = quantity("s", at_least=1e-7, at_most=1, default=0.125e-3)
    friction: float = setting(above=0, default=0.5)  # coefficient, as of metal on a floor


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


@dataclass
class EvolutionScenario:
    """The evolutionary algorithm (Table 6, section 2.3, appendix A).

    It stops when the mean fitness rose by less than `stop_rise` over `stop_window` iterations, not
    before iteration `stop_after`. With `tau_mutation: listing`, mutation never changes tau_A.
    """

    population: int = setting(at_least=2, at_most=100_000)
    tournament: int = setting(at_least=1, at_most=100_000)
    trials: int = setting(at_least=1, at_most=1000)
    max_iterations: int = setting(at_least=1)
    max_evaluations: int | None = setting(at_least=1, default=None)
    """Of a trial by an optimiser other than !SteadyState; if not given, as many as there are in
    max_iterations of that one."""
    crossover_probability: float = setting(at_least=0, at_most=1)
    mutation_probability: float = setting(at_least=0, at_most=1)
    weight_mutation: float = setting(at_least=0)  # largest change of a weight in one mutation
    tau_mutation_range: float = quantity("s", at_least=0)  # largest change of tau_A
    tau_mutation: str = setting(choices=("intended", "listing"))
    gain_mutation: float = setting(at_least=0, default=0.2)  # largest change of a feedback gain
    stop_rise: float = setting(at_least=0)
    stop_window: int = setting(at_least=1)
    stop_after: int = setting(at_least=0)
    independent_tau_b: bool = setting()  # tau_B evolves by itself instead of staying at 2 tau_A
    time_budget: float = quantity("s", above=0)  # wall time; a longer simulation counts as failed

    @property
    def budget(self) -> int:
        """Evaluations of a trial that does not end early: max_evaluations, or the population and
        two children in each iteration."""
        return self.max_evaluations or self.population + 2 * self.max_iterations


@dataclass
class ReferenceScenario:
    """Published results of this robot and experiment, shown beside ours; each may be left out.

    A file inherits it from its base while it changes only name, evolution, engine and integration.
    """

    source: str = setting()
    duration: float | None = quantity("s", above=0, default=None)  # of the walks measured
    best_initial_distance: float | None = quantity("m", default=None)  # of random gaits
    best_distance: float | None = quantity("m", default=None)  # of evolved gaits
    mean_improvement: float | None = setting(default=None)  # % by evolution, mean over trials
    best_improvement: float | None = setting(default=None)  # % in the best trial
    iteration_time: float | None = quantity("s", above=0, default=None)  # wall time
    share_backward: str = setting(default="")  # of initial gaits, in words
    # Absolute differences of the two best gaits of the best trial:
    two_best_fitness: float | None = setting(default=None)  # in fitness (in)
    two_best_weights: list[float] = setting(default=[])  # in each weight
    two_best_tau: float | None = quantity("s", default=None)  # in either time constant


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
    reference: ReferenceScenario | None = setting(default=None)

    @property
    def oscillators(self) -> int:
        """One neural oscillator for each group of cables of each junction between tetrahedra."""
        return len(self.robot.actuation) * (self.robot.tetrahedra - 1)

    @property
    def draws(self) -> int:
        """Simulations of a gait in evolution: one, or one for each draw of disturbances."""
        return self.disturbances.draws if self.disturbances else 1

    def with_changes(self, changes: Mapping[str, Any]) -> Self:
        """A checked copy with other values: {"robot.tetrahedra": 7, "cables.damping": "8 N*s/m"}.

        The same rules hold as in a file that is based on this scenario: quantities have units,
        mappings are merged, and the spacing and the reference follow what is changed. Dataclasses,
        whose numbers are SI, replace their section or kind as a whole: {"friction": Coulomb()}.
        Raises InputError, naming the key.
        """
        source, base = f"scenario {self.name}", tree_of(self)
        given: Tree = Check(source).value(type(self), tree_of_changes(changes, base, source))
        for section in rules.WHOLE:
            if section in given and section not in changes:  # as {"objective.lead": "2 /in"}
                given[section] = base[section] | given[section]
        return self.from_tree(rules.on_base(base, given), source)

    @classmethod
    def from_tree(cls, tree: dict[str, Any], source: object) -> Self:
        """The scenario of an SI tree; raises InputError that names `source` and key."""
        scenario: Self = Check(source, complete=True).value(cls, tree)
        _balance(scenario, source)
        _check_relations(scenario, source)
        if not scenario.objective:
            raise InputError(source, "objective", "found no metric, expected one at least")
        _check_disturbances(scenario, tree, source)
        return scenario


def _balance(scenario: Scenario, source: object) -> None:
    """Gives a `balanced` spacing its number: there, the cables of a junction balance along x.

    Three outer cables of length s pull two tetrahedra together. Three inner ones, from a tip at
    height h to base nodes at s along and R across, push them apart while s < h.
    """
    robot, cables = scenario.robot, scenario.cables
    height, radius = robot.strut_length * math.sqrt(2.0 / 3.0), robot.strut_length / math.sqrt(3.0)

    def pull(s: float) -> float:
        length = math.hypot(radius, height - s)
        inner = cables.inner_stiffness * (length - cables.free_length) * (height - s) / length
        return cables.outer_stiffness * (s - cables.free_length) - inner

    if robot.spacing != rules.BALANCED:
        return
    near, far = 0.0, height + cables.free_length
    if pull(near) >= 0.0:
        raise InputError(source, "robot.spacing", "the cables balance at no spacing; give one")
    while near < (middle := 0.5 * (near + far)) < far:
        near, far = (near, middle) if pull(middle) > 0.0 else (middle, far)
    robot.spacing = far


def _check_relations(scenario: Scenario, source: object) -> None:
    """Checks values of a scenario against each other; raises InputError."""
    bounds, simulation, n = scenario.gait_bounds, scenario.simulation, scenario.robot.tetrahedra
    offsets, start, end = len(scenario.robot.offsets), simulation.steady_from, simulation.duration
    law, step = scenario.friction, scenario.cpg.listing_step
    mu, most = (law.kinetic, law.static) if isinstance(law, Coulomb) else (0.0, 0.0)
    ranges = {
        name: (getattr(bounds, f"{name}_min"), getattr(bounds, f"{name}_max"))
        for name in ("weight", "tau_a", "gain")
    }
    for wrong, key, found, expected in (
        *(
            (low > high, f"gait_bounds.{name}_min", low, f"at most {name}_max, {high}")
            for name, (low, high) in ranges.items()
        ),
        (start >= end, "simulation.steady_from", f"{start} s", f"less than the duration, {end} s"),
        (mu > most, "friction.kinetic", mu, f"at most static, {most}"),
        (offsets not in (0, n), "robot.offsets", f"{offsets} items", f"none or {n}, one each"),
        (step > end, "cpg.listing_step", f"{step} s", f"at most the duration, {end} s"),
        *_size_relations(scenario),
        *_network_relations(scenario),
        *_map_relations(scenario),
    ):
        if wrong:
            raise InputError(source, key, f"found {found}, expected {expected}")


def _check_disturbances(scenario: Scenario, tree: dict[str, Any], source: object) -> None:
    """Checks that every number a draw may change can be changed that far; raises InputError."""
    settings = scenario.disturbances
    if settings is None:
        return
    key = "disturbances.terrain"
    if settings.terrain and not hasattr(scenario.terrain, "seed"):
        kind = type(scenario.terrain).__name__
        raise InputError(source, key, f"found true, expected false: !{kind} has no seed")
    tree = tree | {"disturbances": None}
    for joined, keys in rules.key_groups(settings.spreads):
        key, spread = f"disturbances.spreads.{joined}", settings.spreads[joined]
        numbers = {name: _number(scenario, name, key, source) for name in keys}
        for factor in (1.0 - spread, 1.0 + spread):
            changed = {name: factor * number for name, number in numbers.items()}
            try:
                Scenario.from_tree(with_values(tree, changed), source)
            except InputError as error:
                problem = f"{spread:g} leads to a wrong {error.key}: {error.problem}"
                raise InputError(source, key, problem) from error


def _number(scenario: Scenario, name: str, key: str, source: object) -> float:
    """The number at a dotted key, which `disturbances` changes at `key`."""
    section, _, rest = name.partition(".")
    sections = {k: vars(v) for k, v in vars(scenario).items() if dataclasses.is_dataclass(v)}
    known = [f"{k}.{n}" for k, v in sections.items() for n, x in v.items() if type(x) is float]
    if name not in known:
        raise InputError(source, key, f"'{name}' is no number of the scenario; {hint(name, known)}")
    return float(sections[section][rest])


def _size_relations(scenario: Scenario) -> Iterator[tuple[bool, str, Any, str]]:
    """As _network_relations(), of what has to fit in memory."""
    simulation = scenario.simulation
    signals = simulation.duration * scenario.oscillators / MOST_SIGNALS[simulation.engine]
    samples = simulation.duration * scenario.robot.tetrahedra / MOST_SAMPLES
    for key, period, least in (
        ("cpg.listing_step", scenario.cpg.listing_step, signals),
        ("mujoco.step", scenario.mujoco.step, signals * (simulation.engine == "mujoco")),
        ("simulation.sample_period", simulation.sample_period, samples),
    ):
        expected = f"at least {least:.3g} s for this duration and robot, to fit in memory"
        yield period < least, key, f"{period} s", expected


def _network_relations(scenario: Scenario) -> list[tuple[bool, str, Any, str]]:
    """What may be wrong with groups, steering and feedback: whether it is, key, found, expected."""
    groups, bounds, cpg = scenario.robot.actuation, scenario.gait_bounds, scenario.cpg
    cables = [cable for group in groups for cable in group]
    twice = [cable for cable in cables if cables.count(cable) > 1][:1]
    alone = [group for group in groups if {*mirrored(group)} not in map(set, groups)][:1]
    sided = any(all(cable.endswith(side) for cable in g) for g in groups for side in SIDES)
    needs_live, weightless = bool(cpg.feedback), scenario.robot.gravity == 0.0
    actuation, turn, live = "robot.actuation", "gait_bounds.turn", "'live' for feedback of"
    return [
        (not groups or not all(groups), actuation, groups, "groups of at least one cable"),
        (bool(twice), actuation, f"{twice} twice", "each cable once at most"),
        (bounds.turn != 0.0 and not sided, turn, bounds.turn, "0, as no group is on one side"),
        (
            bounds.mirrored and bool(alone),
            *("gait_bounds.mirrored", "true", f"false, as {alone} has no mirror image"),
        ),
        (
            "load" in cpg.feedback and weightless,
            *("robot.gravity", "0 m/s^2", "a weight, for feedback of the load"),
        ),
        (
            needs_live and cpg.signals != "live",
            *("cpg.signals", f"'{cpg.signals}'", f"{live} {cpg.feedback}"),
        ),
    ]


def _map_relations(scenario: Scenario) -> list[tuple[bool, str, Any, str]]:
    """As _network_relations(), of the map of !QualityDiversity."""
    kind, key = scenario.optimizer, "optimizer.measures"
    if not isinstance(kind, QualityDiversity):
        return []
    count = len(kind.measures)
    return [(count != 2, key, f"{count} metrics", "two, one for each side of the map")] + [
        (low >= high, f"{key}.{name}", low, f"less than the range's end, {high}")
        for name, (low, high) in kind.measures.items()
    ]


def mirrored(cables: Sequence[str]) -> list[str]:
    """The cables of a junction on the other side of the robot, by their names in CABLES."""
    swap = dict(zip(SIDES, reversed(SIDES), strict=True))
    return ["_".join(swap.get(part, part) for part in cable.split("_")) for cable in cables]
