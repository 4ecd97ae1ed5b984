"""A scenario: every number of an experiment, read from a YAML file with units.

The file is text with units ("25 lbf/in"); the sections below hold SI numbers. A field gives its SI
unit, its limits and, if a file may leave it out, its default.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import Field, PrivateAttr, model_validator

from tetra_drake.scenario.cable_names import Cable
from tetra_drake.scenario.disturbances import Disturbances
from tetra_drake.scenario.friction_kinds import Friction
from tetra_drake.scenario.metric_units import METRICS, inverse
from tetra_drake.scenario.optimizer_kinds import OptimizerKind, SteadyState
from tetra_drake.scenario.relations import balanced_spacing, check_relations
from tetra_drake.scenario.sections import (
    TAG,
    Section,
    Tree,
    Whole,
    merge,
    named_quantities,
    quantity,
    refuse,
    tree_of,
    tree_of_changes,
)
from tetra_drake.scenario.terrain_kinds import Flat, Terrain
from tetra_drake.scenario.yaml_text import dump_yaml

EngineName = Literal["drake", "compiled", "mujoco"]
ENGINES: tuple[str, ...] = get_args(EngineName)

Pathway = Literal["length", "load", "pitch"]
"""A signal that can be fed back to the oscillators; see physics.feedback."""

PATHWAYS: tuple[str, ...] = get_args(Pathway)


class RobotSection(Section):
    """The tetrahedra and where they stand (thesis section 2.1, appendix C.1)."""

    tetrahedra: int = Field(ge=2, le=200)
    strut_length: float = quantity("m", gt=0)
    strut_diameter: float = quantity("m", gt=0)
    node_diameter: float = quantity("m", gt=0)
    density: float = quantity("kg/m^3", gt=0)
    spacing: float = quantity("m", ge=0, words={"balanced": 0.0})
    """Distance of base triangles at t = 0. `balanced`, or 0, is the one at which outer and inner
    cables balance. A file that changes strut length or the cables' stiffness or free length of its
    base, but no spacing, gets it, too."""
    gravity: float = quantity("m/s^2", ge=0)
    offsets: list[Annotated[list[float], Field(min_length=3, max_length=3)]] = quantity(
        "m", default=[]
    )
    """Displacement [x, y, z] of each tetrahedron at t = 0; none if empty."""
    contacts: Literal["thesis", "all"] = "thesis"
    """Nodes that the ground can touch: those of the thesis, which are the two bottom nodes of every
    tetrahedron and the tip of the first in line, or all four of every tetrahedron. Only flat
    ground leaves the others untouched."""
    actuation: list[list[Cable]] = Field(default=[["outer bottom_left", "outer bottom_right"]])
    """Groups of a junction's cables that share an oscillator, the same for every junction."""

    @model_validator(mode="after")
    def _check(self) -> RobotSection:
        if len(self.offsets) not in (0, self.tetrahedra):
            problem = f"found {len(self.offsets)} items, expected none or {self.tetrahedra}"
            refuse("offsets", f"{problem}, one for each tetrahedron")
        if not self.actuation or not all(self.actuation):
            refuse("actuation", f"found {self.actuation}, expected groups of at least one cable")
        cables = [cable for group in self.actuation for cable in group]
        for cable in cables:
            if cables.count(cable) > 1:
                refuse("actuation", f"found '{cable}' twice, expected each cable once at most")
        return self


class GroundSection(Section):
    """The normal force (Table 1)."""

    stiffness: float = quantity("N/m", gt=0)
    damping: float = quantity("N*s/m^2", ge=0)
    """lambda = 3/2 alpha stiffness, where alpha (s/m) lowers the restitution of an impact at the
    speed v: e = 1 - alpha v (Eq. 2)."""


class CableSection(Section):
    """The tension members (Table 3). A slack cable has tension 0 where it would push."""

    outer_stiffness: float = quantity("N/m", gt=0)
    inner_stiffness: float = quantity("N/m", gt=0)
    damping: float = quantity("N*s/m", ge=0)
    free_length: float = quantity("m", ge=0)
    slack: bool


class CpgSection(Section):
    """The Matsuoka oscillators (Table 4) and how their signal reaches the cables."""

    self_inhibition_weight: float = Field(ge=0)
    """beta."""
    external_input: float
    """u0."""
    initial_state: Annotated[list[float], Field(min_length=3, max_length=3)]
    """At t = 0: u of every neuron, v of extensors, v of flexors."""
    partner_weight: float = Field(ge=0)
    """Inhibition between extensor and flexor of an oscillator."""
    gain: float = quantity("N")
    """Force per unit of y_extensor - y_flexor."""
    start_up: float = quantity("s", ge=0)
    """Time until which the cables are not actuated."""
    signals: Literal["listing", "live"]
    """`listing`: made beforehand by forward Euler, as in the thesis's listing. `live`: the network
    is integrated with the robot, which feedback needs."""
    listing_step: float = quantity("s", ge=1e-6)
    reach: int | None = Field(default=None, ge=0)
    """Oscillators of junctions at most so far apart inhibit each other; all if not given."""
    feedback: list[Pathway] = Field(default=[])
    """What is fed back, by gains that are parameters of the gait."""

    @model_validator(mode="after")
    def _check(self) -> CpgSection:
        if self.feedback and self.signals != "live":
            refuse("signals", f"found '{self.signals}', expected 'live' for feedback")
        return self


class GaitBounds(Section):
    """Where random gaits are drawn from (Table 5). Equal bounds fix a parameter."""

    weight_min: float = Field(ge=0)
    weight_max: float = Field(ge=0)
    tau_a_min: float = quantity("s", gt=0)
    tau_a_max: float = quantity("s", gt=0)
    turn: float = Field(default=0.0, ge=-1, le=1)
    """The turn of all gaits that are drawn or evolved."""
    mirrored: bool = False
    """Whether weights are drawn and evolved in pairs, left and right alike."""

    @model_validator(mode="after")
    def _check(self) -> GaitBounds:
        if self.weight_min > self.weight_max:
            problem = f"found {self.weight_min}, expected at most weight_max, {self.weight_max}"
            refuse("weight_min", problem)
        if self.tau_a_min > self.tau_a_max:
            problem = f"found {self.tau_a_min} s, expected at most tau_a_max, {self.tau_a_max} s"
            refuse("tau_a_min", problem)
        return self


class SimulationSection(Section):
    """How long to simulate, on which engine, how finely, and when to give up.

    From `scheme` to `look_ahead`, the settings are those of the engine `drake`. Contact and
    stiction (modes) change at the end of steps, or are localised by a witness function.
    """

    engine: EngineName
    duration: float = quantity("s", gt=0, le=1e5)
    steady_from: float = quantity("s", ge=0)
    """Time from which the fitness counts (section 2.3)."""
    scheme: Literal["radau3", "runge_kutta3"]
    accuracy: float = Field(gt=0)
    """Target accuracy per step."""
    max_step: float = quantity("s", gt=0)
    mode_changes: Literal["step_end", "witness"]
    look_ahead: float = quantity("s", ge=0)
    """With step_end and radau3: shortest step that ends at a predicted mode change; 0 for none."""
    max_evaluations: int = Field(ge=1)
    """Evaluations of the derivatives in one simulation."""
    sample_period: float = quantity("s", gt=0)
    """Time between samples of a recorded trajectory."""

    @model_validator(mode="after")
    def _check(self) -> SimulationSection:
        if self.steady_from >= self.duration:
            problem = f"found {self.steady_from} s, expected less than the duration"
            refuse("steady_from", f"{problem}, {self.duration} s")
        return self


SHORTEST_STEP = 1e-9
"""Lower limit (s) of the steps of the engine `compiled`."""


class CompiledSection(Section):
    """How finely the engine `compiled` simulates."""

    tolerance: float = quantity("m/s", gt=0)
    """Error of a body's velocity, or of its strut tips' by rotation, allowed per step."""
    max_step: float = quantity("s", gt=SHORTEST_STEP, le=1)
    look_ahead: float = quantity("s", gt=SHORTEST_STEP, le=1)
    """Time from a predicted mode change to the end of the step that aims at it."""


MUJOCO_FRICTION = 0.5
"""Coefficient of MuJoCo's friction, as of metal on a floor, in place of the thesis's law."""


class MujocoSection(Section):
    """How finely the engine `mujoco` simulates."""

    step: float = quantity("s", default=0.125e-3, ge=1e-7, le=1)


class EvolutionSection(Section):
    """The evolutionary algorithm (Table 6, section 2.3, appendix A).

    It stops when the mean fitness rose by less than `stop_rise` over `stop_window` iterations, not
    before iteration `stop_after`.
    """

    population: int = Field(ge=2, le=100_000)
    tournament: int = Field(ge=1, le=100_000)
    trials: int = Field(ge=1, le=1000)
    evaluations: int = Field(ge=1)
    """Of a trial that does not end early, by any optimiser. !SteadyState makes one for each member
    of the population, then two in each iteration."""
    crossover_probability: float = Field(ge=0, le=1)
    mutation_probability: float = Field(ge=0, le=1)
    weight_mutation: float = Field(ge=0)
    """Largest change of a weight in one mutation."""
    tau_mutation_range: float = quantity("s", ge=0)
    """Largest change of tau_A in one mutation."""
    tau_mutation: Literal["intended", "listing", "independent"]
    """`intended`: tau_A mutates, and tau_B stays 2 tau_A. `listing`: as in the thesis's listing,
    neither does. `independent`: both do, and every optimiser varies tau_B by itself."""
    stop_rise: float = Field(ge=0)
    stop_window: int = Field(ge=1)
    stop_after: int = Field(ge=0)
    time_budget: float = quantity("s", gt=0)
    """Wall time of a simulation; a longer one counts as failed."""


class Scenario(Section):
    """Everything that defines an experiment but the gait."""

    name: str
    robot: RobotSection
    ground: GroundSection
    friction: Friction
    terrain: Terrain = Flat()
    cables: CableSection
    cpg: CpgSection
    gait_bounds: GaitBounds
    simulation: SimulationSection
    compiled: CompiledSection
    mujoco: MujocoSection = MujocoSection()
    objective: dict[str, float] = named_quantities({k: inverse(u) for k, u in METRICS.items()})
    """What evolution maximises: the sum of metrics times these weights, such as `speed: 2 s/in`.
    Lengths count in inches. A file replaces its base's objective as a whole."""
    require: dict[str, float] = named_quantities(METRICS, default={})
    """Least values of metrics: a gait with less counts as failed. Replaced as a whole."""
    disturbances: Disturbances | None = None
    evolution: EvolutionSection
    optimizer: OptimizerKind = SteadyState()

    _tree: Tree | None = PrivateAttr(default=None)
    """The scenario as its files have it, with the units of who wrote them."""

    def __str__(self) -> str:
        return dump_yaml(self.tree)

    def __eq__(self, other: object) -> bool:
        # Units in which a number was written do not matter.
        return type(other) is type(self) and vars(other) == vars(self)

    @property
    def tree(self) -> Tree:
        """What a complete file of this scenario holds, in the units in which it was written."""
        return self._tree or tree_of(self)

    @property
    def oscillators(self) -> int:
        """One neural oscillator for each group of cables of each junction between tetrahedra."""
        return len(self.robot.actuation) * (self.robot.tetrahedra - 1)

    @property
    def draws(self) -> int:
        """Simulations of a gait in evolution: one, or one for each draw of disturbances."""
        return self.disturbances.draws if self.disturbances else 1

    @classmethod
    def from_tree(cls, tree: Tree, source: object, *, key: str = "") -> Self:
        """The scenario of a complete tree; raises InputError that names `source` and key."""
        scenario = super().from_tree(tree, source, key=key)
        if scenario.robot.spacing == 0.0:
            spacing = balanced_spacing(scenario.robot, scenario.cables, source)
            scenario = scenario.with_numbers({"robot.spacing": spacing})
        scenario._tree = _with_tags(tree, scenario)
        check_relations(scenario, source)
        return scenario

    def with_changes(self, changes: Mapping[str, Any]) -> Self:
        """A checked copy with other values: {"robot.tetrahedra": 7, "cables.damping": "8 N*s/m"}.

        The same rules hold as in a file that is based on this scenario: quantities have units,
        mappings are merged, and the spacing follows what is changed. A kind may be given by its tag
        ("engine": "!Compiled"). Sections, whose numbers are SI, replace what they change as a
        whole: {"friction": Coulomb()}. Raises InputError, naming the key.
        """
        source = f"scenario {self.name}"
        given = tree_of_changes(changes, source)
        return self.based(_as_a_whole(given, changes), source)

    def based_on_this(self, given: Tree, source: object) -> Self:
        """The scenario of a file that names this one as its base and holds a tree."""
        return self.based(_as_a_whole(given, given), source)

    def based(self, given: Tree, source: object) -> Self:
        """A copy with what a tree gives."""
        tree = merge(self.tree, given)
        changed = self.from_tree(tree, source)
        if "spacing" in given.get("robot", {}) or _decisive(changed) == _decisive(self):
            return changed
        return self.from_tree(merge(tree, {"robot": {"spacing": "balanced"}}), source)

    def with_sections(self, **sections: Any) -> Self:
        """A copy with other sections, which are not checked."""
        changed = self.model_copy(update=sections)
        changed._tree = None
        return changed

    def with_numbers(self, numbers: Mapping[str, float]) -> Self:
        """A copy with other SI numbers by dotted keys, which are not checked."""
        changed = self
        for key, number in numbers.items():
            section, _, name = key.partition(".")
            copy = getattr(changed, section).model_copy(update={name: number})
            changed = changed.with_sections(**{section: copy})
        return changed

    def numbers(self) -> dict[str, float]:
        """The SI numbers of the sections, by their dotted keys."""
        return {
            f"{key}.{name}": value
            for key, section in self
            if isinstance(section, Section)
            for name, value in section
            if type(value) is float
        }


def _as_a_whole(given: Tree, keys: Iterable[str]) -> Tree:
    """The tree of a file, whose objective and requirements replace those of its base."""
    whole = {
        name: Whole(given[name])
        for name in ("objective", "require")
        if name in keys and isinstance(given[name], dict)
    }
    return given | whole


def _with_tags(tree: Tree, scenario: Scenario) -> Tree:
    """The tree with the tags of all kinds, so that another kind does not merge with them."""
    kinds = ("friction", "terrain", "optimizer")
    tagged = {k: {TAG: type(getattr(scenario, k)).__name__} | tree[k] for k in kinds if k in tree}
    return tree | tagged


def _decisive(scenario: Scenario) -> tuple[float, ...]:
    """Numbers on which the balanced spacing depends.

    The weight does not count: twice the density moves T1 by less than 0.003 in.
    """
    cables = scenario.cables
    stiffness = cables.outer_stiffness, cables.inner_stiffness
    return *stiffness, cables.free_length, scenario.robot.strut_length
