"""A scenario: every number of an experiment, read from a YAML file with units.

The file is text with units ("25 lbf/in"); the dataclasses below hold SI numbers. The field's
`unit` says what SI unit that is, and every check a value must pass stands beside it.
(Drake's YAML loader reads the annotations as types, so they are not postponed here.)
"""

import math
from dataclasses import dataclass, field
from typing import Any


def _quantity(unit: str, **limits: float) -> Any:
    """A field that holds a number of SI unit `unit` and is written as text with a unit."""
    return field(default=math.nan, metadata={"unit": unit, **limits})


def _number(**limits: float) -> Any:
    """A field that holds a plain number, within `limits` (above, at_least, at_most)."""
    return field(default=math.nan, metadata=limits)


def _count(*, at_least: int) -> Any:
    return field(default=0, metadata={"at_least": at_least})


def _choice(*choices: str) -> Any:
    return field(default="", metadata={"choices": choices})


@dataclass
class RobotScenario:
    """The tetrahedra and where they stand (thesis section 2.1, appendix C.1)."""

    tetrahedra: int = _count(at_least=2)
    strut_length: float = _quantity("m", above=0)
    strut_diameter: float = _quantity("m", above=0)
    node_diameter: float = _quantity("m", above=0)
    density: float = _quantity("kg/m^3", above=0)
    spacing: float = _quantity("m", above=0)
    """Distance between neighbouring base triangles at t = 0."""
    gravity: float = _quantity("m/s^2", at_least=0)


@dataclass
class GroundScenario:
    """The normal force (Table 1). `stiffness` and `damping` act; the other two explain them."""

    restitution: float = _number(above=0, at_most=1)
    """e: the coefficient of restitution the thesis aimed at."""
    velocity_correction: float = _quantity("s/m", above=0)
    """alpha: e = 1 - alpha v for an impact at the low speed v (Eq. 2)."""
    stiffness: float = _quantity("N/m", above=0)
    damping: float = _quantity("N*s/m^2", at_least=0)
    """lambda = 3/2 alpha stiffness (Eq. 2)."""


@dataclass
class FrictionScenario:
    """The reset-integrator friction (Table 2)."""

    stiction_range: float = _quantity("m", above=0)
    """p0: the deflection at which a node breaks free."""
    stiction_damping: float = _quantity("N*s/m", at_least=0)
    """sigma_1."""
    stiction_switch: float = _number(at_least=0)
    """a_c."""
    proportional_stiction: float = _quantity("N*s/m^2", at_least=0)
    """sigma_0."""


@dataclass
class CableScenario:
    """The tension members (Table 3)."""

    outer_stiffness: float = _quantity("N/m", above=0)
    inner_stiffness: float = _quantity("N/m", above=0)
    damping: float = _quantity("N*s/m", at_least=0)
    free_length: float = _quantity("m", at_least=0)
    slack: bool = False
    """Whether a cable goes slack (tension clamped at 0) instead of pushing."""


@dataclass
class CpgScenario:
    """The Matsuoka oscillators (Table 4) and how their signal reaches the cables."""

    self_inhibition_weight: float = _number(at_least=0)
    """beta."""
    external_input: float = _number()
    """u0."""
    inner_state: float = _number()
    """u of every neuron at t = 0."""
    extensor_self_inhibition: float = _number()
    """v of the extensors at t = 0."""
    flexor_self_inhibition: float = _number()
    """v of the flexors at t = 0."""
    partner_weight: float = _number(at_least=0)
    """Inhibition between the extensor and the flexor of one oscillator."""
    gain: float = _quantity("N")
    """Force per unit of y_extensor - y_flexor."""
    start_up: float = _quantity("s", at_least=0)
    """The cables are not actuated before this time."""
    signals: str = _choice("listing", "recorded", "live")
    """Where signals come from: the thesis's own forward-Euler listing, the network
    integrated alone beforehand with error control, or the network as a live system."""
    listing_step: float = _quantity("s", above=0)
    """The step of the thesis's listing."""


@dataclass
class GaitBoundsScenario:
    """Where random gaits are drawn from (Table 5). Equal bounds of tau_A fix it."""

    weight_min: float = _number(at_least=0)
    weight_max: float = _number(at_least=0)
    tau_a_min: float = _quantity("s", above=0)
    tau_a_max: float = _quantity("s", above=0)


ENGINES = ("drake", "compiled")


@dataclass
class SimulationScenario:
    """How long to simulate, on which engine, how finely, and when to give up.

    From `scheme` to `witness_window`, the settings are those of the engine `drake`.
    """

    engine: str = _choice(*ENGINES)
    """The Drake diagram, or the same laws compiled end to end."""
    duration: float = _quantity("s", above=0)
    steady_from: float = _quantity("s", at_least=0)
    """Start of the stretch that the fitness measures (thesis section 2.3)."""
    scheme: str = _choice(
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
    accuracy: float = _number(above=0)
    """Drake's target accuracy of a step; unused by schemes without an error estimate."""
    max_step: float = _quantity("s", above=0)
    mode_changes: str = _choice("step_end", "witness")
    """Where contact and stiction change: at the end of steps, or localised by a witness."""
    look_ahead: float = _quantity("s", at_least=0)
    """With mode changes at step ends and an implicit scheme: the shortest step taken so that one
    ends where a mode change is predicted; 0 for no look-ahead."""
    witness_window: float = _quantity("s", above=0)
    """How closely a witness localises a mode change."""
    max_evaluations: int = _count(at_least=1)
    """Allowance of derivative evaluations for one simulation."""
    max_speed: float = _quantity("m/s", above=0)
    """A faster body counts as diverged."""
    sample_period: float = _quantity("s", above=0)
    """Least time between the samples of a recorded trajectory."""


@dataclass
class CompiledScenario:
    """How finely the engine `compiled` simulates."""

    tolerance: float = _quantity("m/s", above=0)
    """Error allowed in one step: of a body's velocity, or of its strut tips' by rotation."""
    max_step: float = _quantity("s", above=0)
    look_ahead: float = _quantity("s", above=0)
    """How long after a predicted mode change a step ends that aims at it."""


@dataclass
class FitnessScenario:
    """The constants phi_1 to phi_4 of the fitness (Table 7, Eq. 10), for lengths in inches."""

    distance: float = _number()
    twist: float = _number()
    direction: float = _number()
    drift: float = _number()


@dataclass
class EvolutionScenario:
    """The evolutionary algorithm (Table 6, section 2.3, appendix A)."""

    population: int = _count(at_least=2)
    tournament: int = _count(at_least=1)
    trials: int = _count(at_least=1)
    max_iterations: int = _count(at_least=1)
    crossover: str = _choice("uniform")
    crossover_probability: float = _number(at_least=0, at_most=1)
    mutation_probability: float = _number(at_least=0, at_most=1)
    weight_mutation: float = _number(at_least=0)
    """Largest change of a weight in one mutation."""
    tau_mutation_range: float = _quantity("s", at_least=0)
    """Largest change of tau_A in one mutation."""
    tau_mutation: str = _choice("intended", "listing")
    """`listing` keeps an index slip by which mutation never changes tau_A."""
    stop_rise: float = _number(at_least=0)
    """Stop when the mean fitness rose by less than this over `stop_window` iterations ..."""
    stop_window: int = _count(at_least=1)
    stop_after: int = _count(at_least=0)
    """... but not before this iteration."""
    independent_tau_b: bool = False
    """Whether tau_B evolves by itself instead of staying at 2 tau_A."""
    time_budget: float = _quantity("s", above=0)
    """Wall time after which an evaluation counts as failed; meant never to be reached."""


@dataclass
class Scenario:
    """Everything that defines an experiment but the gait; all numbers in SI units."""

    name: str = ""
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

    @property
    def oscillators(self) -> int:
        """One neural oscillator for each junction between tetrahedra."""
        return self.robot.tetrahedra - 1
