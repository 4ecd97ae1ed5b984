"""Options that several commands have, and what commands say and draw."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tetra_drake.options import Option, integer, number, quantity, size
from tetra_drake.scenario.shipped import shipped_scenarios, shipped_structures
from tetra_drake.settings.units import INCH

if TYPE_CHECKING:
    from tetra_drake.figures.style import Print
    from tetra_drake.robot.gait import Gait
    from tetra_drake.scenario.scenario import Scenario

say = partial(print, flush=True)


def warn(text: str) -> None:
    """Prints a warning of a command, apart from its results."""
    print(f"tetra-drake: {text}", file=sys.stderr, flush=True)


Folder = Annotated[Path, Option(metavar="DIR", type=Path)]
File = Annotated[Path, Option(metavar="FILE", type=Path)]
Count = Annotated[int, Option(metavar="N", type=partial(integer, least=1))]
Seed = Annotated[int, Option(metavar="N", type=partial(integer, least=0))]
Rate = Annotated[
    float,
    Option(
        metavar="RATE",
        type=quantity("Hz", "100 Hz", least="0.001 Hz", most="1 MHz", plain=True),
    ),
]
Reach = Annotated[
    float,
    Option(metavar="LENGTH", type=quantity("m", "14.34 in", least="0.001 mm", most="1000 km")),
]
Width = Annotated[
    float, Option(metavar="LENGTH", type=quantity("m", "3.4 in", least="2 in", most="40 in"))
]
UnitName = Annotated[str, Option(metavar="UNIT")]
Size = Annotated[tuple[int, int], Option(metavar="WxH", type=size)]
FontSize = Annotated[float, Option(metavar="X", type=partial(number, least=2, most=40))]
FrameRate = Annotated[float, Option(metavar="X", type=partial(number, least=0.01, most=240))]
PlaybackSpeed = Annotated[float, Option(metavar="X", type=partial(number, least=0.001, most=1000))]
View = Annotated[str, Option(choices=("free", "side", "front", "top"))]
Cluster = Annotated[str, Option(metavar="ADDRESS", nargs="?", const="")]
Quantities = Annotated[list[str], Option(metavar="QUANTITY", nargs="+")]
Labels = Annotated[list[str], Option(metavar="NAME", nargs="+")]
RunFolder = Annotated[Folder, Option(metavar="RUN")]
GaitOrRun = Annotated[Path, Option(metavar="GAIT|RUN", type=Path)]
RunOrResult = Annotated[Path, Option(metavar="RUN_DIR|RESULT_DIR", type=Path)]
ResultOrGait = Annotated[Path, Option(metavar="RESULT_DIR|GAIT|RUN_DIR", type=Path)]

_SCENARIO = f"a shipped scenario ({', '.join(shipped_scenarios())}) or a YAML file"
_GAIT = "a gait file (JSON), or a folder written by `evolve` for its best gait"
_SEED = "a random gait of this seed instead (default: one that walks)"
_STRUCTURE = f"a structure or MJCF file, one of {', '.join(shipped_structures())}, or a scenario"
_COMMAND = "a file of actuator commands (CSV) instead, as `export` writes"
_ENGINE = "drake (the diagram), compiled (the same laws), or mujoco (default: the scenario's)"

FitPath = Annotated[Path, Option(metavar="FIT", type=Path)]
ScenarioName = Annotated[str, Option(_SCENARIO, metavar="NAME|FILE")]
GaitPath = Annotated[Path, Option(_GAIT, metavar="FILE|RUN", type=Path, group="gait")]
GaitSeed = Annotated[Seed, Option(_SEED, group="gait")]
CommandFile = Annotated[File, Option(_COMMAND, group="gait")]
EngineName = Annotated[str, Option(_ENGINE, metavar="NAME")]
StructureName = Annotated[str, Option(_STRUCTURE, metavar="NAME|FILE|SCENARIO")]


def print_of(width: float, font: float, *, title: bool, pdf: bool) -> Print:
    """Settings for the files of figures, from options of a command. The width is in m, the size of
    letters `font` in points. `pdf` adds PDF to the file types."""
    from tetra_drake.figures.style import FILE_KINDS, Look, Print

    look = Look(width_in=width / INCH, font_size=font, title=title)
    return Print(look, kinds=[*FILE_KINDS, "pdf"] if pdf else FILE_KINDS)


def scenario_and_gait(
    scenario: str | None, gait: Path | None, seed: int | None, engine: str | None = None
) -> tuple[Scenario, Gait]:
    """The scenario, with the named engine, and the gait that a command simulates, from its options.
    `gait` is a gait file or the folder of a run. Without it, the gait is random, by `seed` or by a
    seed that walks. The scenario has the body that evolved with the gait, if any."""
    from tetra_drake.evolution.run import load_source
    from tetra_drake.robot.parameter_space import WALKING_SEED, seeded_gait, with_body
    from tetra_drake.scenario.load import load_scenario

    if gait is None:
        chosen = load_scenario(scenario or "thesis").on_engine(engine)
        return chosen, seeded_gait(chosen, WALKING_SEED if seed is None else seed)
    source = load_source(gait, scenario=scenario, warn=warn)
    return with_body(source.scenario.on_engine(engine), source.best)
