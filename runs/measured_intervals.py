"""Predictions with 90 % intervals for the page of measured robots, kept in files as they are made.

A case of measured/cases.yaml is a structure with its tolerances, further unknowns, and the
quantities of its tests. Draws within tolerances and unknowns give each quantity's interval.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pandas
from measured_robots import (
    AXES,
    HERE,
    JUMPER,
    LENGTHS,
    SELF_STRESSES,
    SIMPLEX,
    UPPER,
    compression,
    in_the_air,
    jump,
    lengthened,
    load_on_simplex,
    load_steps,
    on_its_own,
    pose,
    stressed,
    structure_of,
    vibrating,
)
from scipy.optimize import brentq, linear_sum_assignment
from scipy.spatial.transform import Rotation
from script import read_settings

from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.files import read_json, write_whole
from tetra_drake.lab.predict.predict import drawn_scenarios, errors_of, intervals
from tetra_drake.lab.predict.variates import Variate, variates_of
from tetra_drake.lab.study.equilibrium import study_equilibrium
from tetra_drake.robot.equilibrium import Unactuated
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.settling import axial_forces
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario

KEPT = HERE / "predictions"
"""Folder of the finished cases. A case whose file is there is not computed again."""
SEED = 0

_GIVEN = read_settings(HERE / "cases.yaml")
CASES, ELEMENTS = _GIVEN["cases"], _GIVEN["elements"]
"""The cases by the names of their files in KEPT, and the simplex's cables by their names there."""
KINDS = {word: kind for kind, words in _GIVEN["kinds"].items() for word in words}
"""Kind and unit of a quantity as a text, by its first word without number."""
FACTS = read_json(HERE / "blind_measured.json", "measured values")


Unknowns = dict[str, float]
"""Unknown numbers by name."""
Values = dict[str, float]
"""Quantities of a test by name, in the units of KINDS."""


class Case(NamedTuple):
    """Quantities of one structure that are predicted together."""

    given: Mapping[str, Any]
    """Entry of CASES."""
    scenario: Callable[[], Scenario]
    unknowns: Unknowns
    """Middles of the unknown numbers."""
    variates: Sequence[Variate]
    """Their errors, in the same order. Those with the same text before a colon are one line in the
    table of shares."""
    predict: Callable[[Scenario, Unknowns], Values]
    """Quantities of a draw."""
    measured: Callable[[], Values]
    """Measured values by quantity."""


def predicted(name: str, case: Case) -> pandas.DataFrame:
    """Median and 90 % interval of each quantity of a case, with what makes most of the interval;
    from its file in KEPT if it is there."""
    file = KEPT / f"{name}.csv"
    if not file.exists():
        text = made(case).to_csv(index=False, float_format="%.6g", lineterminator="\n")
        write_whole(file, text)
    rows = pandas.read_csv(file)
    measured = rows["quantity"].map(case.measured())
    return rows.assign(measured=measured, assumed=case.given["assumed"])


def made(case: Case) -> pandas.DataFrame:
    """Intervals of a case, for its file. Raises InputError if no draw is possible."""
    scenario, draws = case.scenario(), case.given["draws"]
    variates = variates_of(scenario.model_dump(), scenario.all_tolerances)
    every = [*variates, *case.variates]
    errors = errors_of(every, SEED, draws)
    drawn = drawn_scenarios(scenario, variates, errors[:, : len(variates)])
    able = {k: each for k, each in enumerate(drawn) if isinstance(each, Scenario)}
    if not able:
        raise next(each for each in drawn if isinstance(each, InputError))
    sizes = [deviation for each in case.variates for deviation in each.deviations.values()]
    numbers = [*case.unknowns.values()] + np.array(sizes) * errors[:, len(variates) :]
    found = {}
    for k, each in able.items():
        unknown = dict(zip(case.unknowns, numbers[k].tolist(), strict=True))
        with contextlib.suppress(InputError):  # there is no equilibrium
            found[k] = case.predict(each, unknown)
    table = pandas.DataFrame.from_dict(found, orient="index").reindex(range(draws))
    rows, shares = intervals(every, errors, table)
    kinds, units = zip(*map(kind_and_unit, rows.index), strict=True)
    most = [_most(share) for _, share in shares.iterrows()]
    whole = rows.rename_axis("quantity").reset_index()
    whole = whole.assign(structure=case.given["structure"], kind=kinds, unit=units)
    names = ["structure", "quantity", "kind", "unit", *rows]
    return whole[names].assign(**{"mostly from": most})


def committed() -> pandas.DataFrame:
    """The blind predictions as they were committed, with what was measured afterwards."""
    rows = pandas.read_csv(HERE / "blind.csv")
    rows.insert(2, "kind", [kind_and_unit(quantity)[0] for quantity in rows["quantity"]])
    measured = {
        (case.given["structure"], quantity): value
        for case in cases().values()
        for quantity, value in case.measured().items()
    }
    keys = pandas.MultiIndex.from_frame(rows[["structure", "quantity"]])
    return rows.assign(measured=keys.map(measured))


def kind_and_unit(quantity: str) -> tuple[str, str]:
    """Kind and unit of a quantity."""
    kind, unit = KINDS[quantity.split()[0].rstrip("0123456789")].split(" in ")
    return kind, unit


def _most(shares: pandas.Series) -> str:
    """The two largest shares, as text."""
    largest = shares.dropna().nlargest(2)
    return "; ".join(f"{key} {100.0 * share:.0f} %" for key, share in largest.items())


# The simplex


def bowed(longer: Callable[[float], Scenario], unknown: Unknowns, self_stress: float) -> Robot:
    """A simplex whose tubes are bowed. `longer` gives the one with straight tubes that are longer
    by a length (m), which is 0 at the self-stress (N).

    A tube that is bowed by a at no load is shorter by pi^2 a^2 / 4 l / (1 - P / Pcr)^2.
    """
    bow = math.hypot(SIMPLEX["sag"], unknown["bow of the tubes"])
    least = (math.pi * bow) ** 2 / (4.0 * SIMPLEX["tube_length"])
    critical = SIMPLEX["buckling"] * (1.0 + unknown["buckling load"])

    def shortening(force: float) -> float:
        return least / (1.0 - force / critical) ** 2 - least / (1.0 - self_stress / critical) ** 2

    shorter = 0.0
    for _ in range(8):
        robot = Robot.of(longer(-shorter))
        now, before = compression(robot), shorter
        shorter = shortening(
            brentq(
                lambda x, p, d: shortening(x) - d - SIMPLEX["softness"] * (p - x),
                -critical,
                critical * (1.0 - 1e-6),
                args=(now, before),
            )
        )
        if abs(shorter - before) < 2e-6:
            break
    return robot


def readings(robot: Robot, unknown: Unknowns) -> Values:
    """Heights of the upper nodes and forces of the members of a simplex, with what a reading
    adds."""
    study = study_equilibrium(robot)
    found = {ELEMENTS[cable]: x / 1e3 for cable, x in study.cables["tension"].items()}
    struts = axial_forces(robot.structure, Unactuated(robot.model), robot.equilibrium.state)
    found |= {f"S{i}": -force / 1e3 for i, force in enumerate(struts.tolist(), start=1)}
    gain = 1.0 + unknown["gain of the force readings"]
    found = {key: force * gain for key, force in found.items()}
    all_heights = unknown["heights of a test"]
    found |= {f"H{node[1]}": 1e3 * study.nodes.loc[node, "z"] + all_heights for node in UPPER}
    return {key: value + unknown[f"reading:{key}"] for key, value in found.items()}


def prestressed(
    scenario: Scenario, unknown: Unknowns, self_stress: float
) -> tuple[Scenario, float, float]:
    """A simplex with a self-stress (kN) as far as it is known, how much longer its tubes are for
    that (m), and its self-stress in N."""
    wanted = 1e3 * self_stress + unknown["self-stress"]
    first = SIMPLEX["softness"] * wanted + 0.6e-3  # longer than any error of the lengths
    return *stressed(scenario, wanted, first=first, within=2.0), wanted


def simplex_tests(
    scenario: Scenario,
    unknown: Unknowns,
    *,
    self_stress: float,
    loads: Sequence[float] = (),
    lengthenings: Sequence[float] = (),
    means: bool = False,
    **_: Any,
) -> Values:
    """Heights and forces of the simplex under loads (kN) per upper node, or their means; or its
    forces as one tube is lengthened, in mm from the self-stress (kN) on."""
    base, wanted = prestressed(scenario, unknown, self_stress)[1:]
    tests = {f"{load:.2f} kN": (load * (1.0 + unknown["load"]), 0.0) for load in loads}
    tests |= {f"{by:+g} mm": (0.0, by + unknown["lengthening"]) for by in lengthenings}
    values: Values = {}
    for name, (load, own) in tests.items():

        def longer(by: float, load: float = load, own: float = own) -> Scenario:
            one = lengthened(lengthened(scenario, base + by), own / 1e3, struts=1)
            return one.with_changes(load_on_simplex(load))

        found = pandas.Series(readings(bowed(longer, unknown, wanted), unknown))
        if lengthenings:
            found = found[found.index.str[0] != "H"]
        if means:
            found = found.groupby(found.index.str[:-1]).mean()
        values |= {f"{key} at {name}": value for key, value in found.items()}
    return values


def loads_measured(file: str, loads: Sequence[float], means: bool, **_: Any) -> Values:
    """Measured heights and forces of the simplex under loads; see simplex_tests()."""
    steps, found = load_steps(file), Values()
    for load in loads:
        nearest = min(steps, key=lambda step: abs(step[0] - load))[1]
        values = nearest.groupby("kind" if means else "element")["value"].mean()
        found |= {f"{name} at {load:.2f} kN": value for name, value in values.items()}
    return found


def tightened_measured(lengthenings: Sequence[float], **_: Any) -> Values:
    """Measured forces of the simplex as one tube is lengthened; see simplex_tests()."""
    table = pandas.read_csv(HERE / "simplex_tightening.csv")
    table = table[(table["figure"] == "5c") & (table["quantity"] == "force")]
    return {
        f"{member} at {by:+g} mm": float(np.interp(by, own["x"], own["value"]))
        for member, own in table.groupby("element")
        for by in lengthenings
        if own["x"].min() < by < own["x"].max()
    }


def simplex_frequencies(
    scenario: Scenario, unknown: Unknowns, self_stresses: Sequence[float]
) -> Values:
    """First frequencies of the simplex by its self-stress (kN). The cables' mass is spread along
    them: by Rayleigh's quotient for the mode without that."""
    values: Values = {}
    for stress in self_stresses:
        own, *_ = prestressed(scenario, unknown, stress)
        study = study_equilibrium(Robot.of(vibrating(own)))
        mode = dict(zip(study.nodes.index, study.modes[0], strict=True))
        structure = structure_of(scenario)
        bars = [(mode[a], mode[b]) for a, b in structure.struts["tube"].pairs]
        ropes = [tuple(map(mode.__getitem__, cable.split()[1:])) for cable in study.cables.index]
        masses = structure_of(study.robot.scenario).masses
        moving = sum(masses[node] * mode[node] @ mode[node] for node in SIMPLEX["vibrating"])
        moving += SIMPLEX["tube"] / 3.0 * sum(a @ a + a @ b + b @ b for a, b in bars)
        less = SIMPLEX["cable"] / 6.0 * sum((a - b) @ (a - b) for a, b in ropes)
        stiffer = (1.0 + unknown["supports that stick"]) * (1.0 + unknown["bending at joints"])
        factor = stiffer * (1.0 + unknown["rest of the model"]) / math.sqrt(1.0 - less / moving)
        frequency = study.frequencies[0] * factor / math.sqrt(1.0 + unknown["masses in motion"])
        values[f"frequency at {stress:.1f} kN"] = frequency
    return values


def frequencies_measured(self_stresses: Sequence[float]) -> Values:
    """Measured first frequencies of the simplex by its self-stress (kN)."""
    return {f"frequency at {stress:.1f} kN": SELF_STRESSES[stress] for stress in self_stresses}


# The spine


def spine_tests() -> pandas.DataFrame:
    """Poses of the spine in twelve tests with the same cable lengths."""
    files = ("spine_poses.csv", "spine_poses_further.csv")
    return pandas.concat([pandas.read_csv(HERE / file) for file in files])


def spine_path(scenario: Scenario, unknown: Unknowns, leap: int) -> Values:
    """Mean and range of the spine's poses on a path of cable lengths, as a camera sees them, for
    each test. One in `leap` sets of lengths is computed, and the last one."""
    poses = spine_tests()
    tests = poses["test"].unique().tolist()
    table = poses[poses["test"] == tests[0]]
    wanted = table[[f"wanted_{column}" for column, _ in AXES.values()]].to_numpy()
    ways = np.gradient(wanted[:, :2], axis=0)
    steps = [*range(0, len(table) - 1, leap), len(table) - 1]
    differences = []
    for step in steps:
        lengths = table[LENGTHS].iloc[step] + [unknown[f"winding:{i}"] for i in range(1, 5)]
        x, z = -unknown["friction"] * ways[step] / np.linalg.norm(ways[step])
        rubbed = {"robot.loads.c": [f"{float(x)!r} N", "0 N", f"{float(z)!r} N"]}
        differences.append(pose(scenario.with_changes(rubbed), lengths) - wanted[step])
    between = [np.interp(range(len(table)), steps, each) for each in np.transpose(differences)]
    seen = (wanted + np.transpose(between)) / [size for _, size in AXES.values()]
    values: Values = {}
    for place, axis in enumerate(AXES):
        mean, spread = seen[:, place].mean() + unknown[f"camera:{axis}"], np.ptp(seen[:, place])
        spread += unknown["noise of the range"] * (0.8 if axis == "angle" else 1.0)
        for test in tests:
            values |= {f"{axis} mean, {test}": mean, f"{axis} range, {test}": spread}
    return values


def spine_measured(**_: Any) -> Values:
    """Measured mean and range of the spine's poses in each test."""
    found: Values = {}
    for axis, (column, size) in AXES.items():
        for test, own in spine_tests().groupby("test"):
            seen = own[column] / size
            found |= {f"{axis} mean, {test}": seen.mean(), f"{axis} range, {test}": np.ptp(seen)}
    return found


# The jumper


def jumper_rises(scenario: Scenario, unknown: Unknowns) -> Values:
    """Rises of the jumper's centre by the share that is wound up. A motion that fails has none."""
    values: Values = {}
    for share in JUMPER["rises"]:
        with contextlib.suppress(SimulationFailure):
            rise, _ = jump(scenario, share + unknown["wound up"])
            values[f"rise at {100.0 * share:.0f} %"] = rise
    return values


def jumps_measured() -> Values:
    """Middles of the measured ranges of the jumper's rises."""
    rises = JUMPER["rises"].items()
    return {f"rise at {100.0 * share:.0f} %": float(np.mean(ends)) for share, ends in rises}


def of_its_file(name: str) -> Scenario:
    """Scenario of a file of HERE."""
    return load_scenario(HERE / f"{name}.yaml")


def standing(name: str) -> Scenario:
    """Scenario of a structure of HERE on stiff ground."""
    return on_its_own(name, **{"ground.stiffness": "20 kN/m"})


def jumper_heights(scenario: Scenario, unknown: Unknowns) -> Values:
    """Heights of the jumper's nodes at rest above the lowest one, sorted."""
    heights = 1e3 * study_equilibrium(Robot.of(scenario)).nodes["z"].to_numpy()
    lowest, *others = sorted(heights + [unknown[f"marker:{i}"] for i in range(1, 13)])
    return {f"height {i}": z - lowest for i, z in enumerate(others, start=2)}


def rest_measured() -> Values:
    """Measured heights of the jumper's nodes."""
    return {f"height {i}": z for i, z in enumerate(FACTS["eth_rest_heights_mm"], 1)}


# The hexagonal prism, and Laika


def prism_frequencies(scenario: Scenario, unknown: Unknowns, modes: int) -> Values:
    """Natural frequencies of the hexagonal prism, ascending."""
    frequencies = study_equilibrium(Robot.of(scenario)).frequencies[:modes]
    factor = 1.0 + unknown["rest of the model"]
    return {f"frequency {i}": x * factor for i, x in enumerate(frequencies.tolist(), start=1)}


def measured_peaks(**_: Any) -> Values:
    """Measured natural frequencies of the prism, each at another one of the modes: all together as
    near to the predicted medians as they can be."""
    peaks = np.array(FACTS["hex_prism_peaks_hz"])
    medians = pandas.read_csv(KEPT / "blind_prism.csv")["median"].to_numpy()
    rows, modes = linear_sum_assignment(np.abs(np.log(peaks[:, None] / medians)))
    return {f"frequency {mode + 1}": peaks[row] for row, mode in zip(rows, modes, strict=True)}


def measured_lifts(**_: Any) -> Values:
    """Measured twists (degrees) at which Laika's feet lift."""
    lifts = FACTS["laika_lift_deg"]
    return {f"lift of the {name} foot": abs(mean) for name, (mean, _) in lifts.items()}


def twisted(scenario: Scenario, degrees: float, axis: np.ndarray) -> Scenario:
    """Laika with half B of its centre vertebra turned about the spine, whose axis goes
    through a place."""
    turn, changes = Rotation.from_euler("y", degrees, degrees=True), dict[str, object]()
    for node, place in structure_of(scenario).nodes.items():
        if "/tB/" in node:
            turned = turn.apply(np.array(place) - axis) + axis
            changes[f"robot.nodes.{node}"] = [f"{v!r} m" for v in turned.tolist()]
    return scenario.with_changes(changes)


def laika_lifts(
    scenario: Scenario,
    unknown: Unknowns,
    *,
    feet: Mapping[str, Any],
    twist: float,
    axis: Sequence[float],
) -> Values:
    """Twists of Laika's centre vertebra (degrees) at which its feet lift. `feet` are by node: names
    of the foot and of its mirror image, whose test is the mirror image, sense of the twist that
    lifts the foot, and its side.

    On the foot's side the spine has mechanical springs, which are pulled in; on the other side a
    lattice. The load of a foot is nearly linear in the twist, so that two loads lead to the twist
    without load.
    """
    structure, values = structure_of(scenario), Values()
    # The draw is made: tolerances of tensions, which are replaced here, would be left over.
    drawn = scenario.with_sections(robot=structure.model_copy(update={"tolerances": {}}))
    pushed = unknown["centre of mass"] / 2.0 / 0.0755
    loads = {"legCconnect": -pushed, "legDconnect": pushed}
    aside = {f"robot.loads.rear/hips/{k}": ["0 N", "0 N", f"{x!r} N"] for k, x in loads.items()}
    for foot, (names, sense, side) in feet.items():
        changes: dict[str, object] = {**aside}
        for name, group in structure.cables.items():
            # The file has the springs on the left; they are on the side of the foot.
            like, pulled = name, 0.0
            if name in ("HL", "HR"):
                like, pulled = ("HL", unknown["pulled in"]) if name[1] == side else ("HR", 0.0)
            a, b = (np.array(structure.nodes[node]) for node in group.pairs[0])
            own = structure.cables[like]
            assert own.tension is not None and own.stiffness is not None  # as the file gives them
            free = float(np.linalg.norm(a - b)) - own.tension / own.stiffness - pulled / 1e3
            law = {"stiffness": f"{own.stiffness!r} N/m", "tension": None}
            law["free_length"] = f"{free!r} m"
            changes |= {f"robot.cables.{name}.{key}": value for key, value in law.items()}
        bent = drawn.with_changes(changes)
        twists = [twisted(bent, each, np.array(axis)) for each in (0.0, sense * twist)]
        rest, less = (study_equilibrium(Robot.of(one)).nodes.loc[foot, "load"] for one in twists)
        lift = (rest - unknown["load that is seen"]) * twist / (rest - less)
        lift = lift * (1.0 + unknown["rest of the model"]) if rest > less else math.nan
        values |= {f"lift of the {name} foot": lift for name in names}
    return values


TESTS: dict[str, tuple[Callable[[str], Scenario], Callable[..., Values], Callable[..., Values]]] = {
    "loads": (in_the_air, simplex_tests, loads_measured),
    "tightened": (in_the_air, simplex_tests, tightened_measured),
    "frequencies": (in_the_air, simplex_frequencies, frequencies_measured),
    "spine": (in_the_air, spine_path, spine_measured),
    "jumps": (of_its_file, jumper_rises, jumps_measured),
    "prism": (in_the_air, prism_frequencies, measured_peaks),
    "lifts": (standing, laika_lifts, measured_lifts),
    "rest": (standing, jumper_heights, rest_measured),
}
"""Scenario of a robot, prediction of a draw and measured values, by test. The settings of the case
are arguments of the last two."""


def case_of(name: str, **settings: Any) -> Case:
    """Case of a name in cases.yaml, with other settings of its test."""
    given = CASES[name]
    given = CASES.get(given.get("like"), {}) | given
    make, predict, measured = TESTS[given["test"]]
    further = given.get("settings", {}) | settings
    unknowns, variates = Unknowns(), list[Variate]()
    for key, (middle, size, *normal) in given["unknowns"].items():
        of_all, _, each = key.partition(":")
        law, deviation = ("normal", size) if normal else ("uniform", size / math.sqrt(3.0))
        for name in [f"{of_all}:{one}" for one in each.split()] or [of_all]:
            unknowns[name] = middle
            variates.append(Variate(of_all, law, {name: deviation}))
    return Case(
        given,
        partial(make, given["robot"]),
        unknowns,
        variates,
        partial(predict, **further),
        partial(measured, **further),
    )


def cases() -> dict[str, Case]:
    """All cases by the names of their files. What has changed since the blind predictions were
    committed is predicted anew; the model of the prism and of Laika is the same."""
    return {name: case_of(name) for name in CASES}
