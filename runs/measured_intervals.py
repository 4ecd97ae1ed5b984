"""Predictions with 90 % intervals for the page of measured robots, kept in files as they are made.

A case is a structure with its tolerances, further unknowns, and the quantities of its tests. Draws
within tolerances and unknowns give each quantity's interval.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import pandas
from measured_robots import (
    HERE,
    JUMPS,
    SADDLE,
    SELF_STRESSES,
    SOFTNESS,
    TUBE,
    UPPER,
    VIBRATING,
    compression,
    in_the_air,
    lengthened,
    pose,
    rise_of,
    stressed,
    structure_of,
    vibrating,
    wound_up,
)
from scipy.optimize import brentq, linear_sum_assignment

from tetra_drake.engines.simulate import simulate_many
from tetra_drake.errors import InputError
from tetra_drake.files import read_json, write_whole
from tetra_drake.lab.predict.predict import drawn_scenarios, errors_of, intervals
from tetra_drake.lab.predict.variates import Variate, variates_of
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.equilibrium import Unactuated
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.struts import axial_forces
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario, scenario_of
from tetra_drake.study.equilibrium import study_equilibrium

KEPT = HERE / "predictions"
"""Folder of the finished cases. A case whose file is there is not computed again."""
SEED = 0

BUCKLING, LENGTH, CABLE = 10.66e3, 2.9998, 0.502
"""Buckling load (N) and length (m) of a tube of the simplex, and mass (kg) of a cable."""
TIGHTENED_FROM = 1.5e3
"""Self-stress (N) of the simplex from which the lengthening of one tube is counted."""
SAG = 0.7e-3
"""Sag (m) of an unloaded tube under its weight."""
ELEMENTS = {
    "bottom n1 n2": "CB1",
    "bottom n0 n1": "CB2",
    "bottom n0 n2": "CB3",
    "top n4 n5": "CT1",
    "top n3 n4": "CT2",
    "top n3 n5": "CT3",
    "vertical n2 n5": "CV3",
    "vertical n1 n4": "CV2",
    "vertical n0 n3": "CV1",
}
"""Names of the simplex's cables in its measurements."""
FACTS = read_json(HERE / "blind_measured.json", "measured values")
LOADING = {1.5: "simplex_loading.csv", 8.5: "simplex_loading_8.5kN.csv"}
"""Files of what was measured under load, by self-stress (kN)."""
LEAP = 6
"""Number of sets of cable lengths from one pose of the spine that is computed to the next. Between
them, the difference from the pose of the authors' statics is interpolated."""
FEET = {
    "front/legD/legboxend": (("front right (A)", "front left (B)"), 1.0, "R"),
    "rear/legD/legboxend": (("rear right (C)", "rear left (D)"), -1.0, "R"),
}
"""Feet of Laika by node: names of the foot and of its mirror image, sense of the twist that lifts
the foot, and its side. The test of the one is the mirror image of the other's."""
SPINE_AXIS = np.array([0.0, 0.0, 0.1785])
LAW = ("stiffness", "tension")
TWIST = 15.0
"""Twist (degrees) of Laika's centre vertebra at which the loads of its feet are computed."""

KINDS = {
    **dict.fromkeys(("H", "height"), ("shape", "mm")),
    **dict.fromkeys(("CB", "CT", "CV", "S"), ("force", "kN")),
    "frequency": ("frequency", "Hz"),
    "rise": ("motion", "m"),
    "lift": ("motion", "degrees"),
    **dict.fromkeys(("x", "y"), ("motion", "mm")),
    "angle": ("motion", "degrees"),
}
"""Kind and unit of a quantity, by its first word without number."""


class Unknown(NamedTuple):
    """A number that no file of the structure has: its middle, and half its width, or the standard
    deviation of a normal law."""

    middle: float
    size: float
    law: str = "uniform"

    @property
    def deviation(self) -> float:
        """Standard deviation."""
        return self.size / math.sqrt(3.0) if self.law == "uniform" else self.size


Draw = tuple[Scenario, dict[str, float]]
"""A structure within its tolerances, and the unknown numbers by name."""


class Case(NamedTuple):
    """Quantities of one structure that are predicted together."""

    structure: str
    scenario: Callable[[], Scenario]
    unknowns: dict[str, Unknown]
    """By name. Those with the same text before a colon are one line in the table of shares."""
    predict: Callable[[Sequence[Draw]], list[dict[str, float]]]
    """Quantities of each draw by name, in the units of KINDS; empty if a draw has no result."""
    draws: int
    assumed: str
    measured: Callable[[], dict[str, float]] = dict
    """Measured values by quantity."""


def predicted(name: str, case: Case) -> pandas.DataFrame:
    """Median and 90 % interval of each quantity of a case, with what makes most of the interval;
    from its file in KEPT if it is there."""
    file = KEPT / f"{name}.csv"
    if not file.exists():
        scenario, unknowns = case.scenario(), case.unknowns
        own = variates_of(scenario.model_dump(), scenario.all_tolerances)
        further = [
            Variate(key.partition(":")[0], each.law, {key: each.deviation})
            for key, each in unknowns.items()
        ]
        errors = errors_of([*own, *further], SEED, case.draws)
        drawn = drawn_scenarios(scenario, own, errors[:, : len(own)])
        able = {k: each for k, each in enumerate(drawn) if isinstance(each, Scenario)}
        numbers = [
            {
                key: each.middle + each.deviation * error
                for (key, each), error in zip(unknowns.items(), row, strict=True)
            }
            for row in errors[:, len(own) :].tolist()
        ]
        if not able:
            raise next(each for each in drawn if isinstance(each, InputError))
        found = case.predict([(each, numbers[k]) for k, each in able.items()])
        table = pandas.DataFrame(found, index=list(able)).reindex(range(case.draws))
        rows, shares = intervals([*own, *further], errors, table)
        rows["mostly from"] = [_most(share) for _, share in shares.iterrows()]
        rows.insert(0, "quantity", rows.index)
        rows.insert(0, "structure", case.structure)
        kinds = [kind_and_unit(str(quantity)) for quantity in rows["quantity"]]
        rows.insert(2, "kind", [kind for kind, _ in kinds])
        rows.insert(3, "unit", [unit for _, unit in kinds])
        KEPT.mkdir(exist_ok=True)
        write_whole(file, rows.to_csv(index=False, float_format="%.6g", lineterminator="\n"))
    rows = pandas.read_csv(file)
    measured = case.measured()
    rows["measured"] = [measured.get(quantity, math.nan) for quantity in rows["quantity"]]
    rows["assumed"] = case.assumed
    return rows


def committed() -> pandas.DataFrame:
    """The blind predictions as they were committed, with what was measured afterwards."""
    rows = pandas.read_csv(HERE / "blind.csv")
    rows.insert(2, "kind", [kind_and_unit(quantity)[0] for quantity in rows["quantity"]])
    measured = {
        (case.structure, quantity): value
        for case in cases().values()
        for quantity, value in case.measured().items()
    }
    keys = zip(rows["structure"], rows["quantity"], strict=True)
    return rows.assign(measured=[measured.get(key, math.nan) for key in keys])


def kind_and_unit(quantity: str) -> tuple[str, str]:
    """Kind and unit of a quantity."""
    return KINDS[quantity.split()[0].rstrip("0123456789")]


def _most(shares: pandas.Series) -> str:
    """The two largest shares, as text."""
    largest = shares.dropna().nlargest(2)
    return "; ".join(f"{key} {100.0 * share:.0f} %" for key, share in largest.items())


def one_by_one(
    predict: Callable[[Scenario, dict[str, float]], dict[str, float]],
) -> Callable[[Sequence[Draw]], list[dict[str, float]]]:
    """Prediction of several draws by one of a single draw; none where there is no equilibrium."""

    def of_all(draws: Sequence[Draw]) -> list[dict[str, float]]:
        found = []
        for scenario, unknown in draws:
            try:
                found.append(predict(scenario, unknown))
            except InputError:
                found.append({})
        return found

    return of_all


# The simplex


def bowed(
    longer: Callable[[float], Scenario], unknown: dict[str, float], self_stress: float
) -> Robot:
    """A simplex whose tubes are bowed. `longer` gives the one with straight tubes that are longer
    by a length (m), which is 0 at the self-stress (N).

    A tube that is bowed by a at no load is shorter by pi^2 a^2 / 4 l / (1 - P / Pcr)^2.
    """
    least = (math.pi * math.hypot(SAG, unknown["bow of the tubes"])) ** 2 / (4.0 * LENGTH)
    critical = BUCKLING * (1.0 + unknown["buckling load"])

    def shortening(force: float) -> float:
        return least / (1.0 - force / critical) ** 2 - least / (1.0 - self_stress / critical) ** 2

    shorter = 0.0
    for _ in range(8):
        robot = Robot.of(longer(-shorter))
        now, before = compression(robot), shorter
        shorter = shortening(
            brentq(
                lambda x, p, d: shortening(x) - d - SOFTNESS * (p - x),
                -critical,
                critical * (1.0 - 1e-6),
                args=(now, before),
            )
        )
        if abs(shorter - before) < 2e-6:
            break
    return robot


def readings(robot: Robot, unknown: dict[str, float]) -> dict[str, float]:
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


def simplex_loads(
    scenario: Scenario,
    unknown: dict[str, float],
    *,
    self_stress: float,
    loads: Sequence[float],
    means: bool,
) -> dict[str, float]:
    """Heights and forces of the simplex under loads (kN) per upper node; or their means."""
    wanted = 1e3 * self_stress + unknown["self-stress"]
    first = SOFTNESS * wanted + 0.6e-3  # longer than any error of the lengths
    _, base = stressed(scenario, wanted, first=first, within=2.0)
    felt = 1.0 + unknown["load"]
    values: dict[str, float] = {}
    for load in loads:
        force = {
            f"robot.loads.{node}": ["0 N", "0 N", f"{-1e3 * load * felt!r} N"] for node in UPPER
        }

        def longer(by: float, force: dict[str, list[str]] = force) -> Scenario:
            return lengthened(scenario, base + by).with_changes(force)

        found = readings(bowed(longer, unknown, wanted), unknown)
        if means:
            table = pandas.Series(found)
            found = table.groupby(table.index.str[:-1]).mean().to_dict()
        values |= {f"{key} at {load:.2f} kN": value for key, value in found.items()}
    return values


def simplex_tightened(
    scenario: Scenario, unknown: dict[str, float], lengthenings: Sequence[float]
) -> dict[str, float]:
    """Forces of the simplex as one tube is lengthened, in mm from TIGHTENED_FROM."""
    wanted = TIGHTENED_FROM + unknown["self-stress"]
    first = SOFTNESS * wanted + 0.6e-3
    _, base = stressed(scenario, wanted, first=first, within=2.0)
    values: dict[str, float] = {}
    for lengthening in lengthenings:
        own = (lengthening + unknown["lengthening"]) / 1e3

        def longer(by: float, own: float = own) -> Scenario:
            return lengthened(lengthened(scenario, base + by), own, struts=1)

        found = readings(bowed(longer, unknown, wanted), unknown)
        forces = {key: value for key, value in found.items() if key[0] != "H"}
        values |= {f"{key} at {lengthening:+g} mm": value for key, value in forces.items()}
    return values


def simplex_tightened_case(lengthenings: Sequence[float]) -> Case:
    """Forces of the simplex as its tube S1 is lengthened, in mm."""
    loaded = simplex_loads_case(TIGHTENED_FROM / 1e3, (), means=False)
    unknowns = {key: each for key, each in loaded.unknowns.items() if key != "load"}

    def measured() -> dict[str, float]:
        table = pandas.read_csv(HERE / "simplex_tightening.csv")
        table = table[(table["figure"] == "5c") & (table["quantity"] == "force")]
        return {
            f"{member} at {by:+g} mm": float(np.interp(by, own["x"], own["value"]))
            for member, own in table.groupby("element")
            for by in lengthenings
            if own["x"].min() < by < own["x"].max()
        }

    return Case(
        "simplex, tightened",
        loaded.scenario,
        unknowns | {"lengthening": Unknown(0.0, 0.03, "normal")},
        one_by_one(lambda scenario, unknown: simplex_tightened(scenario, unknown, lengthenings)),
        60,
        "the tube S1 is lengthened, by steps known to 0.03 mm from a self-stress of 1.5 kN known "
        "to 0.025 kN; tubes, stiffnesses, masses, supports and readings of forces as under load",
        measured,
    )


def simplex_loads_case(self_stress: float, loads: Sequence[float], *, means: bool) -> Case:
    """Heights and forces of the simplex at a self-stress (kN) under loads (kN) per upper node; or
    their means."""
    unknowns = {
        "self-stress": Unknown(0.0, 25.0, "normal"),
        "bow of the tubes": Unknown(0.75e-3, 0.25e-3),
        "buckling load": Unknown(0.0, 0.03, "normal"),
        "load": Unknown(0.0, 0.01, "normal"),
        "gain of the force readings": Unknown(0.0, 0.02, "normal"),
        "heights of a test": Unknown(0.0, 1.5),
    }
    unknowns |= {f"reading:{key}": Unknown(0.0, 0.025, "normal") for key in ELEMENTS.values()}
    unknowns |= {f"reading:S{i}": Unknown(0.0, 0.025, "normal") for i in (1, 2, 3)}
    unknowns |= {f"reading:H{i}": Unknown(0.0, 1.0) for i in (3, 4, 5)}

    def measured() -> dict[str, float]:
        table = pandas.read_csv(HERE / LOADING[self_stress])
        table = table[table["quantity"] != "angle"]
        names = table["element"].str[:-1] if means else table["element"]
        found: dict[str, float] = {}
        at = table.groupby("step")["x"].mean()
        for load in loads:
            step = (at - load).abs().idxmin()
            values = table[table["step"] == step].groupby(names)["value"].mean()
            found |= {f"{name} at {load:.2f} kN": value for name, value in values.items()}
        return found

    def predict(scenario: Scenario, unknown: dict[str, float]) -> dict[str, float]:
        return simplex_loads(scenario, unknown, self_stress=self_stress, loads=loads, means=means)

    return Case(
        f"simplex, {self_stress:g} kN",
        lambda: in_the_air("simplex"),
        unknowns,
        one_by_one(predict),
        100 if means else 60,
        "tubes bowed by 0.5 to 1 mm, in place of the straight ones; stiffnesses and masses to 2 %, "
        "the buckling load to 3 %; pinned ends; a rail without friction; readings to 1 mm and "
        "0.025 kN, all heights of a test to 1.5 mm, all forces to 2 %, loads to 1 %",
        measured,
    )


def simplex_frequencies(
    scenario: Scenario, unknown: dict[str, float], self_stresses: Sequence[float]
) -> dict[str, float]:
    """First frequencies of the simplex by its self-stress (kN). The cables' mass is spread along
    them: by Rayleigh's quotient for the mode without that."""
    values: dict[str, float] = {}
    for stress in self_stresses:
        wanted = 1e3 * stress + unknown["self-stress"]
        first = SOFTNESS * wanted + 0.6e-3
        study = study_equilibrium(
            Robot.of(vibrating(stressed(scenario, wanted, first=first, within=2.0)[0]))
        )
        mode = dict(zip(study.nodes.index, study.modes[0], strict=True))
        structure = structure_of(scenario)
        bars = [(mode[a], mode[b]) for a, b in structure.struts["tube"].pairs]
        ropes = [tuple(map(mode.__getitem__, cable.split()[1:])) for cable in study.cables.index]
        masses = structure_of(scenario_of(study.robot.scenario)).masses
        moving = sum(masses[node] * mode[node] @ mode[node] for node in VIBRATING)
        moving += TUBE / 3.0 * sum(a @ a + a @ b + b @ b for a, b in bars)
        less = CABLE / 6.0 * sum((a - b) @ (a - b) for a, b in ropes)
        stiffer = (1.0 + unknown["supports that stick"]) * (1.0 + unknown["bending at joints"])
        factor = stiffer * (1.0 + unknown["rest of the model"]) / math.sqrt(1.0 - less / moving)
        frequency = study.frequencies[0] * factor / math.sqrt(1.0 + unknown["masses in motion"])
        values[f"frequency at {stress:.1f} kN"] = frequency
    return values


def simplex_frequencies_case(self_stresses: Sequence[float]) -> Case:
    """First frequency of the simplex at self-stresses, in kN."""
    known = {f"frequency at {s:.1f} kN": hz for s, hz in SELF_STRESSES.items()}
    return Case(
        "simplex, frequencies",
        lambda: in_the_air("simplex"),
        {
            "self-stress": Unknown(0.0, 50.0, "normal"),
            "masses in motion": Unknown(0.0, 0.02, "normal"),
            "supports that stick": Unknown(0.02, 0.02),
            "bending at joints": Unknown(0.015, 0.015),
            "rest of the model": Unknown(0.0, 0.04, "normal"),
        },
        one_by_one(lambda scenario, unknown: simplex_frequencies(scenario, unknown, self_stresses)),
        60,
        "the cables' mass spread along them (3 %); up to 4 % for supports that stick and up to 3 % "
        "for bending at the joints; 4 % for what the model may lack; the self-stress to 0.05 kN, "
        "masses to 2 %",
        lambda: {key: hz for key, hz in known.items() if float(key.split()[2]) in self_stresses},
    )


# The spine


def spine_path(
    scenario: Scenario, unknown: dict[str, float], table: pandas.DataFrame, tests: Sequence[str]
) -> dict[str, float]:
    """Mean and range of the spine's poses on a path of cable lengths, as a camera sees them."""
    wanted = table[["wanted_x_m", "wanted_y_m", "wanted_rad"]].to_numpy()
    ways = np.gradient(wanted[:, :2], axis=0)
    steps = [*range(0, len(table) - 1, LEAP), len(table) - 1]
    differences = []
    for step in steps:
        changes: dict[str, object] = {}
        for number, cable in enumerate(SADDLE, start=1):
            length = table[f"l{number}_m"].iloc[step] + unknown[f"winding:{number}"]
            changes[f"robot.cables.{cable}.free_length"] = f"{float(length)!r} m"
        x, z = -unknown["friction"] * ways[step] / np.linalg.norm(ways[step])
        changes["robot.loads.c"] = [f"{float(x)!r} N", "0 N", f"{float(z)!r} N"]
        differences.append(pose(scenario.with_changes(changes)) - wanted[step])
    between = [np.interp(range(len(table)), steps, each) for each in np.transpose(differences)]
    seen = (wanted + np.transpose(between)) * [1e3, 1e3, math.degrees(1.0)]
    values: dict[str, float] = {}
    for place, axis in enumerate(("x", "y", "angle")):
        mean, spread = seen[:, place].mean() + unknown[f"camera:{axis}"], np.ptp(seen[:, place])
        spread += unknown["noise of the range"] * (0.8 if axis == "angle" else 1.0)
        for test in tests:
            values |= {f"{axis} mean, {test}": mean, f"{axis} range, {test}": spread}
    return values


def spine_case() -> Case:
    """Mean and range of the spine's poses in twelve tests with the same cable lengths."""
    files = ("spine_poses.csv", "spine_poses_further.csv")
    table = pandas.concat([pandas.read_csv(HERE / file) for file in files])
    tests = table["test"].unique().tolist()
    path = table[table["test"] == tests[0]]

    def measured() -> dict[str, float]:
        found = {}
        for axis, column, scale in (("x", "x_m", 1e3), ("y", "y_m", 1e3), ("angle", "rad", 0.0)):
            for test, own in table.groupby("test"):
                seen = own[column] * (scale or math.degrees(1.0))
                found[f"{axis} mean, {test}"] = seen.mean()
                found[f"{axis} range, {test}"] = np.ptp(seen)
        return found

    unknowns = {f"winding:{number}": Unknown(0.0, 2e-3) for number in (1, 2, 3, 4)}
    unknowns |= {"camera:x": Unknown(0.0, 2.0, "normal"), "camera:y": Unknown(0.0, 2.0, "normal")}
    unknowns |= {"camera:angle": Unknown(0.0, 0.5, "normal")}
    unknowns |= {"friction": Unknown(0.15, 0.15), "noise of the range": Unknown(1.5, 1.5)}
    return Case(
        "planar spine",
        lambda: in_the_air("spine"),
        unknowns,
        one_by_one(lambda scenario, unknown: spine_path(scenario, unknown, path, tests)),
        60,
        "springs to 5 % and places of cables to 1 mm; cable lengths to 2 mm (calibrated by hand); "
        "friction of the board up to a twentieth of the weight, against the motion; the camera's "
        "frame to 2 mm and 0.5 degrees; noise that widens a range by up to 3 mm or 2.4 degrees",
        measured,
    )


# The jumper


def jumper_rises(draws: Sequence[Draw]) -> list[dict[str, float]]:
    """Rises of the jumper's centre by the share that is wound up, of all draws side by side."""
    values: list[dict[str, float]] = [{} for _ in draws]
    for share in JUMPS:
        commands = [wound_up(each, share + unknown["wound up"]) for each, unknown in draws]
        outcomes = simulate_many([each for each, _ in draws], commands, record=True)
        for own, outcome in zip(values, outcomes, strict=True):
            rise = rise_of(outcome) if isinstance(outcome, SimulationResult) else math.nan
            own[f"rise at {100.0 * share:.0f} %"] = rise
    return values


def jumper_case() -> Case:
    """Jumps after four shares of the actuators' length are wound up."""
    middles = {
        share: np.mean([float(x) for x in text.split(" to ")]) for share, text in JUMPS.items()
    }
    return Case(
        "jumper, jumps",
        lambda: load_scenario(str(HERE / "jump.yaml")),
        {"wound up": Unknown(0.0, 0.01)},
        jumper_rises,
        60,
        "springs to 5 %, their tension to 10 %, their damping 0.5 to 3.5 N s/m; actuators and "
        "ground to 30 %, friction to 15 %; masses spread along straight rods; the share that is "
        "wound up to 1 % of the length; no limit of the actuators' force",
        lambda: {f"rise at {100.0 * share:.0f} %": float(x) for share, x in middles.items()},
    )


def standing(name: str) -> Scenario:
    """Scenario of a structure of HERE on stiff ground."""
    robot = f"!Structure {{file: {HERE / name}.yaml}}"
    changes = {"name": name, "robot": robot, "ground.stiffness": "20 kN/m"}
    return load_scenario("prism").with_changes(changes | {"strut_contact": "!Nothing {}"})


def jumper_heights(scenario: Scenario, unknown: dict[str, float]) -> dict[str, float]:
    """Heights of the jumper's nodes at rest above the lowest one, sorted."""
    heights = 1e3 * study_equilibrium(Robot.of(scenario)).nodes["z"].to_numpy()
    lowest, *others = sorted(heights + [unknown[f"marker:{i}"] for i in range(1, 13)])
    return {f"height {i}": z - lowest for i, z in enumerate(others, start=2)}


# The hexagonal prism, and Laika


def prism_frequencies(scenario: Scenario, unknown: dict[str, float]) -> dict[str, float]:
    """Natural frequencies of the hexagonal prism, ascending."""
    frequencies = study_equilibrium(Robot.of(scenario)).frequencies[:MODES]
    factor = 1.0 + unknown["rest of the model"]
    return {f"frequency {i}": x * factor for i, x in enumerate(frequencies.tolist(), start=1)}


MODES = 9
"""Number of modes of the hexagonal prism below 14 Hz."""


def measured_peaks() -> dict[str, float]:
    """Measured natural frequencies of the prism, each at another one of the modes: all together as
    near to the predicted medians as they can be."""
    peaks = np.array(FACTS["hex_prism_peaks_hz"])
    medians = pandas.read_csv(KEPT / "blind_prism.csv")["median"].to_numpy()
    rows, modes = linear_sum_assignment(np.abs(np.log(peaks[:, None] / medians)))
    return {f"frequency {mode + 1}": peaks[row] for row, mode in zip(rows, modes, strict=True)}


def measured_lifts() -> dict[str, float]:
    """Measured twists (degrees) at which Laika's feet lift."""
    lifts = {name[0]: abs(mean) for name, (mean, _) in FACTS["laika_lift_deg"].items()}
    names = (name for names, *_ in FEET.values() for name in names)
    return {f"lift of the {name} foot": lifts[name[-2]] for name in names}


def twisted(scenario: Scenario, degrees: float) -> Scenario:
    """Laika with half B of its centre vertebra turned about the spine."""
    turn = math.radians(degrees)
    changes: dict[str, object] = {}
    for node, place in structure_of(scenario).nodes.items():
        if "/tB/" not in node:
            continue
        x, y, z = np.array(place) - SPINE_AXIS
        turned = [
            math.cos(turn) * x + math.sin(turn) * z,
            y,
            math.cos(turn) * z - math.sin(turn) * x,
        ]
        changes[f"robot.nodes.{node}"] = [f"{v!r} m" for v in (turned + SPINE_AXIS).tolist()]
    return scenario.with_changes(changes)


def laika_lifts(scenario: Scenario, unknown: dict[str, float]) -> dict[str, float]:
    """Twists of Laika's centre vertebra (degrees) at which its feet lift.

    On the foot's side the spine has mechanical springs, which are pulled in; on the other side a
    lattice. The load of a foot is nearly linear in the twist, so that two loads lead to the twist
    without load.
    """
    values: dict[str, float] = {}
    structure = structure_of(scenario)
    for foot, (names, sense, side) in FEET.items():
        changes: dict[str, object] = {}
        pushed = unknown["centre of mass"] / 2.0 / 0.0755
        for node, force in {"legCconnect": -pushed, "legDconnect": pushed}.items():
            changes[f"robot.loads.rear/hips/{node}"] = ["0 N", "0 N", f"{force!r} N"]
        for name, group in structure.cables.items():
            # The file has the springs on the left; they are on the side of the foot.
            softer, pulled = name, 0.0
            if name in ("HL", "HR"):
                is_pulled = name[1] == side
                softer, pulled = ("HL", unknown["pulled in"]) if is_pulled else ("HR", 0.0)
            a, b = (np.array(structure.nodes[node]) for node in group.pairs[0])
            stiffness, tension = (getattr(structure.cables[softer], key) for key in LAW)
            free = float(np.linalg.norm(a - b)) - tension / stiffness - pulled / 1e3
            changes |= {
                f"robot.cables.{name}.stiffness": f"{stiffness!r} N/m",
                f"robot.cables.{name}.tension": None,
                f"robot.cables.{name}.free_length": f"{free!r} m",
            }
        own, loads = scenario.with_changes(changes), []
        for twist in (0.0, sense * TWIST):
            nodes = study_equilibrium(Robot.of(twisted(own, twist))).nodes
            loads.append(float(nodes.loc[foot, "load"]))
        falling = (loads[0] - loads[1]) / TWIST
        lift = (loads[0] - unknown["load that is seen"]) / falling if falling > 0.0 else math.nan
        lift *= 1.0 + unknown["rest of the model"]
        values |= {f"lift of the {name} foot": lift for name in names}
    return values


def cases() -> dict[str, Case]:
    """All cases by the names of their files. What has changed since the blind predictions were
    committed is predicted anew; the model of the prism and of Laika is the same."""
    loads = (0.0, 0.3, 0.6, 1.0, 2.08)
    return {
        "simplex_loads": simplex_loads_case(1.5, loads, means=True),
        "simplex_frequencies": simplex_frequencies_case((1.5, 2.5)),
        "spine": spine_case(),
        "jumps": jumper_case(),
        "blind_prism": Case(
            "hexagonal prism",
            lambda: in_the_air("hex_prism"),
            {"rest of the model": Unknown(0.0, 0.04, "normal")},
            one_by_one(prism_frequencies),
            200,
            "0.2 to 3.8 g of sensors, marker and joint at each node; strings to 20 %, their "
            "tension to 20 %; nodes to 2 mm; straight stiff bars; hung without effect; 4 % for "
            "what the model may lack",
            measured_peaks,
        ),
        "blind_laika": Case(
            "Laika",
            lambda: standing("laika"),
            {
                "pulled in": Unknown(7.5, 7.5),
                "centre of mass": Unknown(0.0, 0.03, "normal"),
                "load that is seen": Unknown(0.15, 0.15),
                "rest of the model": Unknown(0.0, 0.1, "normal"),
            },
            one_by_one(laika_lifts),
            60,
            "cables of the side to lift pulled in by 0 to 15 mm each, with mechanical springs; "
            "lattice to 10 %, tensions to 3 %, masses to 3 to 10 %, centre of mass to 2 mm "
            "sideways; feet without friction; a foot counts as lifted below 0 to 0.3 N; its load "
            "is linear in the twist to 10 %",
            measured_lifts,
        ),
        "anew_jumper": Case(
            "jumper, at rest",
            lambda: standing("eth_jumper"),
            {f"marker:{i}": Unknown(0.0, 2.0, "normal") for i in range(1, 13)},
            one_by_one(jumper_heights),
            200,
            "springs to 5 %, their free lengths to 3 mm each, rods to 1 mm; heights above the "
            "lowest node; markers to 2 mm; without the slack actuators",
            lambda: {f"height {i}": z for i, z in enumerate(FACTS["eth_rest_heights_mm"], 1)},
        ),
        "anew_simplex_loads": simplex_loads_case(8.5, (0.0, 0.2, 0.4, 0.6, 0.8), means=False),
        "anew_simplex_tightened": simplex_tightened_case((-1.0, 1.0, 2.0, 4.0, 6.0, 8.0, 10.0)),
        "anew_simplex_frequencies": simplex_frequencies_case((3.5, 4.5, 5.5)),
    }
