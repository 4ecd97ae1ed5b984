"""A scenario: every number of an experiment, read from a YAML file with units.

The file is text with units ("25 lbf/in"); the dataclasses below hold SI numbers. The field's
`unit` says what SI unit that is, and every check a value must pass stands beside it.
(Drake's YAML loader reads the annotations as types, so they are not postponed here.)
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Self

from tetra_drake.scenario import rules
from tetra_drake.scenario.fields import (
    Check,
    build,
    choice,
    count,
    flag,
    number,
    quantity,
    text,
    tree_of,
    with_values,
)


@dataclass
class RobotScenario:
    """The tetrahedra and where they stand (thesis section 2.1, appendix C.1)."""

    tetrahedra: int = count(at_least=2)
    strut_length: float = quantity("m", above=0)
    strut_diameter: float = quantity("m", above=0)
    node_diameter: float = quantity("m", above=0)
    density: float = quantity("kg/m^3", above=0)
    spacing: float = quantity("m", above=0, words=(rules.BALANCED,))
    """Distance between neighbouring base triangles at t = 0. `balanced`: the distance at which
    outer and inner cables balance; a file gets that, too, if it changes the cables' stiffness or
    free length, or the struts' length, of its base and gives no spacing."""
    gravity: float = quantity("m/s^2", at_least=0)
    offsets: list[list[float]] = quantity("m", default=[], length=3)
    """Displacement [x, y, z] of each tetrahedron at t = 0; empty: none is displaced."""


@dataclass
class GroundScenario:
    """The normal force (Table 1). `stiffness` and `damping` act; the other two explain them."""

    restitution: float = number(above=0, at_most=1)
    """e: the coefficient of restitution the thesis aimed at."""
    velocity_correction: float = quantity("s/m", above=0)
    """alpha: e = 1 - alpha v for an impact at the low speed v (Eq. 2)."""
    stiffness: float = quantity("N/m", above=0)
    damping: float = quantity("N*s/m^2", at_least=0)
    """lambda = 3/2 alpha stiffness (Eq. 2)."""


@dataclass
class FrictionScenario:
    """The reset-integrator friction (Table 2)."""

    stiction_range: float = quantity("m", above=0)
    """p0: the deflection at which a node breaks free."""
    stiction_damping: float = quantity("N*s/m", at_least=0)
    """sigma_1."""
    stiction_switch: float = number(at_least=0)
    """a_c."""
    proportional_stiction: float = quantity("N*s/m^2", at_least=0)
    """sigma_0."""


@dataclass
class CableScenario:
    """The tension members (Table 3)."""

    outer_stiffness: float = quantity("N/m", above=0)
    inner_stiffness: float = quantity("N/m", above=0)
    damping: float = quantity("N*s/m", at_least=0)
    free_length: float = quantity("m", at_least=0)
    slack: bool = flag()
    """Whether a cable goes slack (tension clamped at 0) instead of pushing."""


@dataclass
class CpgScenario:
    """The Matsuoka oscillators (Table 4) and how their signal reaches the cables."""

    self_inhibition_weight: float = number(at_least=0)
    """beta."""
    external_input: float = number()
    """u0."""
    inner_state: float = number()
    """u of every neuron at t = 0."""
    extensor_self_inhibition: float = number()
    """v of the extensors at t = 0."""
    flexor_self_inhibition: float = number()
    """v of the flexors at t = 0."""
    partner_weight: float = number(at_least=0)
    """Inhibition between the extensor and the flexor of one oscillator."""
    gain: float = quantity("N")
    """Force per unit of y_extensor - y_flexor."""
    start_up: float = quantity("s", at_least=0)
    """The cables are not actuated before this time."""
    signals: str = choice("listing", "recorded", "live")
    """Where signals come from: the thesis's own forward-Euler listing, the network
    integrated alone beforehand with error control, or the network as a live system."""
    listing_step: float = quantity("s", above=0)
    """The step of the thesis's listing."""


@dataclass
class GaitBoundsScenario:
    """Where random gaits are drawn from (Table 5). Equal bounds of tau_A fix it."""

    weight_min: float = number(at_least=0)
    weight_max: float = number(at_least=0)
    tau_a_min: float = quantity("s", above=0)
    tau_a_max: float = quantity("s", above=0)


ENGINES = ("drake", "compiled")


@dataclass
class SimulationScenario:
    """How long to simulate, on which engine, how finely, and when to give up.

    From `scheme` to `witness_window`, the settings are those of the engine `drake`.
    """

    engine: str = choice(*ENGINES)
    """The Drake diagram, or the same laws compiled end to end."""
    duration: float = quantity("s", above=0)
    steady_from: float = quantity("s", at_least=0)
    """Start of the stretch that the fitness measures (thesis section 2.3)."""
    scheme: str = choice(
        "radau3",
        "runge_kutta3",
        "runge_kutta2",
        "runge_kutta5",
        "bogacki_shampine3",
        "implicit_euler",
        "velocity_implicit_euler",
        "radau1",
        "explicit_euler",
        "semi_explicit_euler",
    )
    """One of Drake's integration schemes."""
    accuracy: float = number(above=0)
    """Drake's target accuracy of a step; unused by schemes without an error estimate."""
    max_step: float = quantity("s", above=0)
    mode_changes: str = choice("step_end", "witness")
    """Where contact and stiction change: at the end of steps, or localised by a witness."""
    look_ahead: float = quantity("s", at_least=0)
    """With mode changes at step ends and an implicit scheme: the shortest step taken so that one
    ends where a mode change is predicted; 0 for no look-ahead."""
    witness_window: float = quantity("s", above=0)
    """How closely a witness localises a mode change."""
    max_evaluations: int = count(at_least=1)
    """Allowance of derivative evaluations for one simulation."""
    max_speed: float = quantity("m/s", above=0)
    """A faster body counts as diverged."""
    sample_period: float = quantity("s", above=0)
    """Least time between the samples of a recorded trajectory."""


@dataclass
class CompiledScenario:
    """How finely the engine `compiled` simulates."""

    tolerance: float = quantity("m/s", above=0)
    """Error allowed in one step: of a body's velocity, or of its strut tips' by rotation."""
    max_step: float = quantity("s", above=0)
    look_ahead: float = quantity("s", above=0)
    """How long after a predicted mode change a step ends that aims at it."""


@dataclass
class FitnessScenario:
    """The constants phi_1 to phi_4 of the fitness (Table 7, Eq. 10), for lengths in inches."""

    distance: float = number()
    twist: float = number()
    direction: float = number()
    drift: float = number()


@dataclass
class EvolutionScenario:
    """The evolutionary algorithm (Table 6, section 2.3, appendix A)."""

    population: int = count(at_least=2)
    tournament: int = count(at_least=1)
    trials: int = count(at_least=1)
    max_iterations: int = count(at_least=1)
    crossover: str = choice("uniform")
    crossover_probability: float = number(at_least=0, at_most=1)
    mutation_probability: float = number(at_least=0, at_most=1)
    weight_mutation: float = number(at_least=0)
    """Largest change of a weight in one mutation."""
    tau_mutation_range: float = quantity("s", at_least=0)
    """Largest change of tau_A in one mutation."""
    tau_mutation: str = choice("intended", "listing")
    """`listing` keeps an index slip by which mutation never changes tau_A."""
    stop_rise: float = number(at_least=0)
    """Stop when the mean fitness rose by less than this over `stop_window` iterations ..."""
    stop_window: int = count(at_least=1)
    stop_after: int = count(at_least=0)
    """... but not before this iteration."""
    independent_tau_b: bool = flag()
    """Whether tau_B evolves by itself instead of staying at 2 tau_A."""
    time_budget: float = quantity("s", above=0)
    """Wall time after which an evaluation counts as failed; meant never to be reached."""


@dataclass
class ReferenceScenario:
    """Published results of this robot and experiment, to be shown beside ours.

    A file inherits the reference of its base while it changes only name, engine, integration
    and evolution.
    """

    source: str = text()
    duration: float | None = quantity("s", above=0, default=None)
    """Of the simulations that the distances belong to."""
    best_initial_distance: float | None = quantity("m", default=None)
    """Farthest of the random gaits."""
    best_distance: float | None = quantity("m", default=None)
    """Farthest evolved gait."""
    mean_improvement: float | None = number(default=None)
    """Percentage by which evolution raised the fitness, on average over the trials."""
    best_improvement: float | None = number(default=None)
    """The same of the best trial."""
    iteration_time: float | None = quantity("s", above=0, default=None)
    """Wall time per iteration."""
    share_backward: str = text(default="")
    """Share of the initial gaits that walk backward, in words."""
    two_best_fitness: float | None = number(default=None)
    """Absolute difference between the two best gaits of the best trial: in fitness (in) ..."""
    two_best_weights: list[float] = number(default=[])
    """... in each weight ..."""
    two_best_tau: float | None = quantity("s", default=None)
    """... and in either time constant."""


@dataclass
class Scenario:
    """Everything that defines an experiment but the gait; all numbers in SI units."""

    name: str = text()
    robot: RobotScenario = field(default_factory=RobotScenario)
    ground: GroundScenario = field(default_factory=GroundScenario)
    friction: FrictionScenario = field(default_factory=FrictionScenario)
    cables: CableScenario = field(default_factory=CableScenario)
    cpg: CpgScenario = field(default_factory=CpgScenario)
    gait_bounds: GaitBoundsScenario = field(default_factory=GaitBoundsScenario)
    simulation: SimulationScenario = field(default_factory=SimulationScenario)
    compiled: CompiledScenario = field(default_factory=CompiledScenario)
    fitness: FitnessScenario = field(default_factory=FitnessScenario)
    evolution: EvolutionScenario = field(default_factory=EvolutionScenario)
    reference: ReferenceScenario | None = None

    @property
    def oscillators(self) -> int:
        """One neural oscillator for each junction between tetrahedra."""
        return self.robot.tetrahedra - 1

    def with_changes(self, changes: Mapping[str, Any]) -> Self:
        """A checked copy with other values: {"robot.tetrahedra": 7, "cables.damping": "8 N*s/m"}.

        Values are SI numbers, text with units, or dataclasses for tagged kinds. The spacing
        stays what it is unless it is given; it may be "balanced". The reference goes if the
        changes concern what it depends on. Raises InputError, naming the key.
        """
        source, base = f"scenario {self.name}", tree_of(self)
        tree = with_values(base, changes, source=source)
        tree = Check(source, numbers_are_si=True).section(type(self), tree)
        given = tree if any(key.split(".")[0] == "reference" for key in changes) else {}
        tree = rules.with_valid_reference(tree, base=base, given=given)
        return self.from_tree(tree, source)

    @classmethod
    def from_tree(cls, tree: dict[str, Any], source: str) -> Self:
        """The scenario of an SI tree; raises InputError that names `source` and key."""
        check = Check(source, numbers_are_si=True, complete=True)
        tree = rules.with_balance(check.section(cls, tree), source)
        rules.check_relations(tree, source)
        return build(cls, tree)
