"""A scenario: every number of an experiment, read from a YAML file with units.

The file is text with units ("25 lbf/in"); the dataclasses below hold SI numbers. The field's
`unit` says what SI unit that is, and every check a value must pass stands beside it.
(Drake's YAML loader reads the annotations as types, so they are not postponed here.)
"""

import contextlib
import dataclasses
import difflib
import math
import os
import typing
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

import yaml
from pydrake.common.yaml import yaml_load_typed

from tetra_drake.errors import InputError
from tetra_drake.units import quantity_to_si


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


def shipped_scenarios() -> list[str]:
    """The names of the scenarios that come with the package."""
    folder = resources.files("tetra_drake") / "scenarios"
    return sorted(
        entry.name.removesuffix(".yaml")
        for entry in folder.iterdir()
        if entry.name.endswith(".yaml")
    )


def load_scenario(name_or_file: str | Path = "thesis") -> Scenario:
    """Loads a shipped scenario by its name, or a scenario file by its path.

    Raises InputError, naming file and key, for whatever is wrong in the file.
    """
    tree, source = _load_tree(str(name_or_file), asked_by=None, seen=())
    _require_complete(Scenario, tree, source, prefix="")
    scenario: Scenario = yaml_load_typed(
        schema=Scenario,
        data=yaml.safe_dump(tree),
        defaults=Scenario(),
        allow_schema_with_no_yaml=False,
    )
    _check_consistency(scenario, source)
    return scenario


def with_engine(scenario: Scenario, engine: str | None) -> Scenario:
    """The scenario on another engine; on its own if that is None."""
    if engine is None:
        return scenario
    simulation = dataclasses.replace(scenario.simulation, engine=engine)
    return dataclasses.replace(scenario, simulation=simulation)


def dump_scenario(scenario: Scenario) -> str:
    """The scenario as a complete scenario file: SI units, loads back to the same numbers."""
    return yaml.safe_dump(_to_text(scenario), sort_keys=False)


def _load_tree(
    name_or_file: str, *, asked_by: str | None, seen: tuple[str, ...]
) -> tuple[dict[str, Any], str]:
    """The SI tree of a scenario with its bases merged in, and the name of its source."""
    text, source = _read(name_or_file, asked_by)
    identity = str(Path(source).resolve())
    if identity in seen:
        raise InputError(source, "base", "the scenario is based on itself")
    raw = _parse(text, source)
    base = raw.pop("base", None)
    tree = _to_si(Scenario, raw, source, prefix="")
    if base is None:
        return tree, source
    if not isinstance(base, str) or not base:
        raise InputError(
            source, "base", f"found {_describe(base)}, expected the name of a scenario"
        )
    if base not in shipped_scenarios():
        base = str(Path(source).parent / base)
    base_tree, _ = _load_tree(base, asked_by=source, seen=(*seen, identity))
    return _merge(base_tree, tree), source


def _read(name_or_file: str, asked_by: str | None) -> tuple[str, str]:
    shipped = shipped_scenarios()
    if name_or_file in shipped:
        resource = resources.files("tetra_drake") / "scenarios" / f"{name_or_file}.yaml"
        return resource.read_text(encoding="utf-8"), str(resource)
    path = Path(name_or_file)
    source, key, what = str(path), "", ""
    if asked_by:
        source, key, what = asked_by, "base", f" '{os.path.relpath(path, Path(asked_by).parent)}'"
    try:
        return path.read_text(encoding="utf-8"), str(path)
    except FileNotFoundError as error:
        problem = f"no such scenario file{what}, and no shipped scenario ({', '.join(shipped)})"
        raise InputError(source, key, problem) from error
    except IsADirectoryError as error:
        problem = f"{what} is a directory, expected a scenario file"
        raise InputError(source, key, problem.strip()) from error
    except (OSError, ValueError) as error:
        raise InputError(source, key, f"{what} cannot be read as text: {error}".strip()) from error


class _UniqueKeyLoader(yaml.SafeLoader):
    """YAML without the licence to give a key twice, of which one value would be lost."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys = [self.construct_object(key, deep=True) for key, _ in node.value]
        for key in keys:
            if keys.count(key) > 1:
                raise yaml.constructor.ConstructorError(
                    None, None, f"found the key '{key}' twice", node.start_mark
                )
        return super().construct_mapping(node, deep)


def _parse(text: str, source: str) -> dict[str, Any]:
    try:
        raw = yaml.load(text, _UniqueKeyLoader)
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise InputError(source, "", f"is not YAML: {error}") from error
    if not isinstance(raw, dict):
        raise InputError(source, "", f"found {_describe(raw)}, expected a mapping of keys")
    return raw


def _to_si(schema: type, raw: dict[str, Any], source: str, *, prefix: str) -> dict[str, Any]:
    """Checks every key and value of `raw` against the dataclass and turns them into SI."""
    fields = {f.name: f for f in dataclasses.fields(schema)}
    types = typing.get_type_hints(schema)
    tree: dict[str, Any] = {}
    for name, value in raw.items():
        key = f"{prefix}{name}"
        if name not in fields:
            raise InputError(source, key, f"unknown key{_suggestion(str(name), list(fields))}")
        if dataclasses.is_dataclass(types[name]):
            if not isinstance(value, dict):
                raise InputError(source, key, f"found {_describe(value)}, expected a mapping")
            tree[name] = _to_si(types[name], value, source, prefix=f"{key}.")
            continue
        try:
            tree[name] = _value_to_si(types[name], fields[name].metadata, value)
        except ValueError as error:
            raise InputError(source, key, str(error)) from error
    return tree


def _value_to_si(kind: type, metadata: Any, value: Any) -> Any:
    """One value in SI; raises ValueError that says what was found and what was expected."""
    if "unit" in metadata:
        if not isinstance(value, str):
            raise ValueError(
                f"found {_describe(value)} without a unit, "
                f"expected a quantity that converts to {metadata['unit']}"
            )
        number = quantity_to_si(value, metadata["unit"])
        return _within_limits(number, metadata, shown=f"'{value}'")
    if kind in (int, float):
        number = _plain_number(kind, value)
        return kind(_within_limits(number, metadata, shown=str(number)))
    if not isinstance(value, kind):
        raise ValueError(f"found {_describe(value)}, expected {_TYPE_NAMES[kind]}")
    if "choices" in metadata and value not in metadata["choices"]:
        raise ValueError(f"found '{value}', expected one of {', '.join(metadata['choices'])}")
    return value


def _plain_number(kind: type[int] | type[float], value: Any) -> float:
    if kind is float and isinstance(value, str):  # YAML 1.1 takes 1e-3 for text
        with contextlib.suppress(ValueError):
            value = float(value)
    if isinstance(value, bool) or not isinstance(value, (kind, int)):
        wanted = "an integer" if kind is int else "a number"
        raise ValueError(f"found {_describe(value)}, expected {wanted}")
    number: float = value
    if not abs(number) < 1e300:  # NaN, infinity, and integers beyond floating point
        raise ValueError(f"found {str(value)[:40]}, expected a finite number")
    return number


_TYPE_NAMES = {bool: "true or false", str: "text"}


def _within_limits(number: float, metadata: Any, *, shown: str) -> float:
    if "above" in metadata and not number > metadata["above"]:
        raise ValueError(f"found {shown}, expected more than {metadata['above']}")
    if "at_least" in metadata and not number >= metadata["at_least"]:
        raise ValueError(f"found {shown}, expected at least {metadata['at_least']}")
    if "at_most" in metadata and not number <= metadata["at_most"]:
        raise ValueError(f"found {shown}, expected at most {metadata['at_most']}")
    return number


def _merge(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    merged = dict(base)
    for name, value in changes.items():
        both = isinstance(value, dict) and isinstance(base.get(name), dict)
        merged[name] = _merge(base[name], value) if both else value
    return merged


def _require_complete(schema: type, tree: dict[str, Any], source: str, *, prefix: str) -> None:
    types = typing.get_type_hints(schema)
    for f in dataclasses.fields(schema):
        key = f"{prefix}{f.name}"
        if f.name not in tree:
            raise InputError(
                source, key, "is missing; give it, or begin the file with `base: thesis`"
            )
        if dataclasses.is_dataclass(types[f.name]):
            _require_complete(types[f.name], tree[f.name], source, prefix=f"{key}.")


def _check_consistency(scenario: Scenario, source: str) -> None:
    """Relations between values that no single field can check."""
    bounds, simulation = scenario.gait_bounds, scenario.simulation
    for name, low, high in (
        ("weight", bounds.weight_min, bounds.weight_max),
        ("tau_a", bounds.tau_a_min, bounds.tau_a_max),
    ):
        if low > high:
            raise InputError(
                source,
                f"gait_bounds.{name}_min",
                f"found {low}, expected at most {name}_max, {high}",
            )
    if simulation.steady_from >= simulation.duration:
        raise InputError(
            source,
            "simulation.steady_from",
            f"found {simulation.steady_from} s, expected less than the duration, "
            f"{simulation.duration} s",
        )


def _to_text(node: Any) -> dict[str, Any]:
    text: dict[str, Any] = {}
    for f in dataclasses.fields(node):
        value = getattr(node, f.name)
        if dataclasses.is_dataclass(value):
            text[f.name] = _to_text(value)
        elif "unit" in f.metadata:
            text[f.name] = f"{value!r} {f.metadata['unit']}"
        else:
            text[f.name] = value
    return text


def _describe(value: Any) -> str:
    if value is None:
        return "nothing"
    kinds = {dict: "a mapping", list: "a list", bool: str(value).lower()}
    return kinds.get(type(value), f"'{value}'" if isinstance(value, str) else str(value))


def _suggestion(name: str, known: list[str]) -> str:
    close = difflib.get_close_matches(name, known, n=1)
    if close:
        return f"; did you mean '{close[0]}'?"
    return f"; expected one of {', '.join(known)}"
