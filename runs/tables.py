"""The tables of runs/README.md and README.md, made from the recorded runs beside this file.

    python runs/tables.py [FILE ...]

Each table stands in a Markdown file between two lines:

    <!-- table NAME: made by runs/tables.py -->
    <!-- end -->
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas
from analyse import ANALYSIS, DEFAULT, Analysis, load_analysis
from engines import distances_on_both

from tetra_drake.errors import InputError
from tetra_drake.evolution.optimizers.steady_state import CHILDREN
from tetra_drake.evolution.robustness import inches, percents
from tetra_drake.evolution.tables import Run, load_run
from tetra_drake.files import write_whole
from tetra_drake.formatting import duration, fixed, markdown_table, signed
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import INCH

HERE = Path(__file__).parent
PAGES = (HERE.parent / "README.md", HERE / "README.md", HERE / "gaits.md")

INTENDED, LISTING, DIAGRAM = RUNS = ("thesis", "thesis-listing", "thesis-drake")
"""Folders of the runs: tau_A mutated as intended, as by the listing, evolved on the diagram."""

CLOSE = 0.1
"""in: distances on two engines that differ by less agree."""

_BEGIN = re.compile(r"<!-- table (?P<name>\S+): made by runs/tables.py -->")
_END = "<!-- end -->"


@dataclass(frozen=True)
class Recorded:
    """A recorded run with its analysis."""

    name: str
    record: Run
    trials: pandas.DataFrame
    """Index: trial. Columns as of the evaluation of its fittest gait, and: iterations, ended,
    first_mean and last_mean (mean fitness of the population), initial_distance_in (of the fittest
    initial gait)."""
    analysis: Analysis

    @property
    def scenario(self) -> Scenario:
        """The scenario of the run."""
        return self.record.manifest.scenario

    @property
    def best_trial(self) -> int:
        """The trial with the fittest gait."""
        return int(self.trials["fitness"].idxmax())

    @property
    def initial(self) -> pandas.DataFrame:
        """The evaluations of the initial populations that have not failed."""
        return self.record.initial().dropna(subset="fitness")

    @property
    def best_walk(self) -> pandas.Series:
        """The row of the analysis that describes the fittest gait of all trials."""
        return self.analysis.best_gaits.set_index("trial").loc[self.best_trial]


def load_recorded(directory: Path) -> Recorded:
    """A recorded run; InputError if it or its analysis is missing, damaged or out of date."""
    run, analysis = load_run(directory), load_analysis(directory)
    best = run.best().set_index("trial")
    if dict(best["index"]) != dict(analysis.best_gaits[["trial", "evaluation"]].to_numpy()):
        problem = f"does not hold the run's best gaits; run `python runs/analyse.py {directory}`"
        raise InputError(directory / ANALYSIS, "best_gaits", problem)
    iterations = run.iterations.groupby("trial")
    initial = run.initial().dropna(subset="fitness").sort_values("fitness").groupby("trial")
    trials = best.assign(
        iterations=iterations["iteration"].last(),
        ended=iterations["stop"].last().notna(),
        first_mean=iterations["mean_fitness"].first(),
        last_mean=iterations["mean_fitness"].last(),
        initial_distance_in=initial["distance_in"].last(),
    )
    return Recorded(directory.name, run, trials, analysis)


def load_all(directory: Path = HERE) -> list[Recorded]:
    """All recorded runs, in the order of RUNS."""
    return [load_recorded(directory / name) for name in RUNS]


def comparison_table(runs: Sequence[Recorded]) -> str:
    """The thesis's numbers beside those of the runs."""
    headings = ["", "thesis", *(f"ours, `{run.name}`" for run in runs)]
    rows = [[name, theirs, *(ours(run) for run in runs)] for name, theirs, ours in COMPARISON]
    return markdown_table(headings, rows)


def summary_table(runs: Sequence[Recorded]) -> str:
    """The most important numbers of the first run, for README.md."""
    headings = ["distance in 15 s, inches", "thesis", "[`runs/thesis`](runs/README.md)"]
    return markdown_table(headings, [[name, value, ours(runs[0])] for name, value, ours in SUMMARY])


def _iterations(run: Recorded) -> str:
    iterations = run.trials["iterations"]
    return f"{iterations.median():.0f} ({iterations.max()})"


def _seconds_per_iteration(run: Recorded) -> str:
    return f"{CHILDREN * run.record.evaluations['wall_time_s'].median():.2g}"


def _best_initial(run: Recorded) -> str:
    return fixed(run.initial["distance_in"].max())


def _best_initial_per_trial(run: Recorded) -> str:
    best = run.initial.groupby("trial")["distance_in"].max()
    return f"{fixed(best.mean())} ({_from_to(best)})"


def _mean_initial(run: Recorded) -> str:
    return _best_initial_per_trial(run).partition(" ")[0]


def _backward(run: Recorded) -> str:
    share = (run.initial["distance_in"] < 0.0).mean()
    return f"{100.0 * share:.0f} % of {len(run.initial)}"


def _best_evolved(run: Recorded) -> str:
    return fixed(run.trials["distance_in"][run.best_trial])


def _on_diagram(run: Recorded) -> str:
    again = run.analysis.resimulations.set_index(["trial", "setting"])["distance_in"]
    return fixed(again[(run.best_trial, DEFAULT)])


def _fitness_rise(trials: pandas.DataFrame) -> str:
    return f"{fixed(trials['first_mean'].mean())} → {fixed(trials['last_mean'].mean())}"


def _distance_rise(trials: pandas.DataFrame) -> str:
    rise = trials["distance_in"] / trials["initial_distance_in"] - 1.0
    return f"{fixed(100.0 * rise.mean(), 0)} %"


def _off_ground(run: Recorded) -> str:
    return ", ".join(f"{100.0 * share:.0f}" for share in run.best_walk["off_ground"].values())


def _oscillator_frequency(run: Recorded) -> str:
    return fixed(run.analysis.oscillator_frequency_hz)


def _signal_frequencies(run: Recorded) -> str:
    values = run.best_walk["frequencies_hz"].values()
    return ", ".join("-" if value is None else fixed(value) for value in values)


def _best_tau(run: Recorded) -> str:
    tau = run.trials["tau_a_s"]
    return f"{fixed(tau.median(), 3)} ({fixed(tau.max(), 3)})"


def _two_best(run: Recorded, part: slice) -> str:
    """Difference of the two best of the last population: fitness, weights, tau_A, tau_B."""
    population = run.record.last_population(run.best_trial)
    population = population.sort_values(["fitness", "index"], ascending=[False, True])
    genome = [name for name in population if name.startswith(("weight_", "tau_"))]
    numbers = population.drop_duplicates(genome)[["fitness", *genome]].to_numpy(float)
    values = np.abs(numbers[0] - numbers[1])[part]
    return " to ".join(fixed(value, 4) for value in sorted({values.min(), values.max()}))


Row = tuple[str, str, Callable[[Recorded], str]]

_TWO = "difference of the two best genomes"
_TRIAL_RISE = "rise of the best distance, trial with the best gait"

COMPARISON: list[Row] = [
    ("trials", "10", lambda r: f"{len(r.trials)}"),
    ("iterations of a trial, median (most)", "at most 2000", _iterations),
    ("seconds per iteration", "22", _seconds_per_iteration),
    ("best initial distance, in", "about 6.6", _best_initial),
    ("best initial distance per trial, mean (range), in", "–", _best_initial_per_trial),
    ("initial gaits that go backward", "nearly half", _backward),
    ("best evolved distance, in", "14.34", _best_evolved),
    ("the same gait on the Drake diagram, in", "–", _on_diagram),
    ("mean fitness, average trial, in", "rises in all trials", lambda r: _fitness_rise(r.trials)),
    ("mean fitness, best trial, in", "–", lambda r: _fitness_rise(r.trials.loc[[r.best_trial]])),
    ("rise of the best distance, average trial", "32 %", lambda r: _distance_rise(r.trials)),
    (_TRIAL_RISE, "51 %", lambda r: _distance_rise(r.trials.loc[[r.best_trial]])),
    ("time off the ground of T1, T2, T3, T4, T5, best gait, %", "no number", _off_ground),
    ("frequency of a single oscillator, τ_A = 0.3 s, Hz", "about 0.7", _oscillator_frequency),
    ("frequency of each signal, best gait, Hz", "no number", _signal_frequencies),
    ("τ_A of the best gaits, median (most), s", "to the limit, 0.2", _best_tau),
    (f"{_TWO}: fitness, in", "0.0006", lambda r: _two_best(r, slice(0, 1))),
    (f"{_TWO}: weights, least to most", "0 to 0.3806", lambda r: _two_best(r, slice(1, -2))),
    (f"{_TWO}: τ_A, s", "0", lambda r: _two_best(r, slice(-2, -1))),
]
"""Names, numbers of the thesis (abstract, sections 2.3, 2.4, 3.1, 3.2, Table 8), and ours."""

SUMMARY: list[Row] = [
    ("best initial gait, mean of ten populations", "6.6 (one)", _mean_initial),
    ("best evolved gait", "14.34", _best_evolved),
    ("the same gait on the Drake diagram", "", _on_diagram),
    ("best evolved gait, mean of ten trials", "", lambda r: fixed(r.trials["distance_in"].mean())),
    ("seconds per iteration (two simulations)", "22", _seconds_per_iteration),
]


def runs_table(runs: Sequence[Recorded]) -> str:
    """What the runs are, and the command that repeats each."""
    columns = [_run_facts(run) for run in runs]
    rows = [[name, *(facts[name] for facts in columns)] for name in columns[0]]
    headings = ["", *(f"`{run.name}`" for run in runs)]
    return markdown_table(headings, rows, text_columns=range(len(headings)))


def _run_facts(run: Recorded) -> dict[str, str]:
    manifest, evaluations = run.record.manifest, run.record.evaluations
    return {
        "engine": run.scenario.simulation.engine,
        "mutation of the time constants": run.scenario.evolution.tau_mutation,
        "trials": f"{len(run.trials)}, {run.trials['ended'].sum()} of them ended",
        "seed": f"{manifest.seed}",
        "evaluations": f"{len(evaluations)}",
        "of which failed": f"{int(evaluations['failure'].notna().sum())}",
        "simulation took (h:mm:ss)": duration(float(evaluations["wall_time_s"].sum())),
        "evaluated again on the Drake diagram": f"{len(run.record.reevaluations)}",
        "versions": ", ".join(f"{name} {number}" for name, number in manifest.versions.items()),
        "makes it again": f"`tetra-drake evolve --scenario runs/{run.name}/scenario.yaml "
        f"--seed {manifest.seed} --out again`",
    }


def best_gaits_table(runs: Sequence[Recorded]) -> str:
    """The best gait of each trial: distance, time constant, frequencies, time off the ground."""
    rows, headings = [], ["best gait", "distance, in", "τ_A, s", "signals, Hz"]
    for run in runs:
        walks = run.analysis.best_gaits.set_index("trial")
        for trial, gait in run.trials.iterrows():
            off, hertz = walks.loc[trial, "off_ground"], walks.loc[trial, "frequencies_hz"]
            swings = [value for value in hertz.values() if value is not None]
            numbers = [fixed(gait["distance_in"]), fixed(gait["tau_a_s"], 3), _from_to(swings)]
            shares = [f"{100.0 * share:.0f}" for share in off.values()]
            rows.append([f"`{run.name}`, trial {trial}", *numbers, *shares])
            headings[4:] = [f"{name} lifted, %" for name in off]
    return markdown_table(headings, rows)


def resimulation_table(runs: Sequence[Recorded]) -> str:
    """The best gait of each trial on the Drake diagram with several integrator settings.

    Below each run, the absolute difference from the default settings, median and greatest.
    """
    rows = []
    for run in runs:
        again = run.analysis.resimulations
        settings = list(dict.fromkeys(again["setting"]))
        table = again.pivot(index="trial", columns="setting", values="distance_in")[settings]
        table.insert(0, "as recorded", run.trials["distance_in"])
        for trial, distances in table.iterrows():
            rows.append([f"`{run.name}`, trial {trial}", *map(fixed, distances)])
        differences = table.sub(table[DEFAULT], axis=0).abs()
        for name, values in (("median", differences.median()), ("greatest", differences.max())):
            cells = ["" if key == DEFAULT else fixed(value) for key, value in values.items()]
            rows.append([f"*`{run.name}`: {name} difference*", *cells])
    return markdown_table(["best gait", *table.columns], rows)


def robustness_table(runs: Sequence[Recorded]) -> str:
    """What hurts the best gaits of runs of ten trials most."""
    several = [run for run in runs if len(run.trials) > 1]
    tables = [run.analysis.changes.set_index("what") for run in several]
    rows = [
        [what, *(cell for table in tables for cell in _change_cells(table.loc[what]))]
        for what in tables[0].index
    ]
    heads = ("alone: median change (worst), in", "rank correlation: mean (median size)")
    headings = [f"`{run.name}`, {head}" for run in several for head in heads]
    return markdown_table(["changed by 5 %", *headings], rows)


def _change_cells(row: pandas.Series) -> list[str]:
    failed = f", {row['failed']:.0f} failed" if row["failed"] else ""
    worst = f"({signed(row['worst'] / INCH)}{failed})"
    ranks = f"{signed(row['correlation'])} ({fixed(row['correlation_size'])})"
    scaled = math.isfinite(row["correlation"])
    return [f"{fixed(row['median'] / INCH)} {worst}", ranks if scaled else "-"]


def robust_gaits_table(runs: Sequence[Recorded]) -> str:
    """How far each gait walks under draws of all changes, and how many it keeps."""
    rows, names = [], ("undisturbed", "5 %", "50 %", "95 %")
    for run in runs:
        for trial, row in run.analysis.gaits.set_index("gait").iterrows():
            mean, kept = (row[[name, f"{name}_low", f"{name}_high"]] for name in ("mean", "kept"))
            cells = [fixed(row[name] / INCH) for name in names]
            rows.append([f"`{run.name}`, trial {trial}", *cells, inches(*mean), percents(*kept)])
        if len(run.trials) > 1:
            over = run.analysis.over_gaits.set_index("of")
            before, mean, kept = (over.loc[name] for name in ("undisturbed", "mean", "kept"))
            middle = [inches(*before), "", "", "", inches(*mean), percents(*kept)]
            rows.append([f"*`{run.name}`: median of the gaits*", *middle])
    headings = ["best gait", *(f"{name}, in" for name in names), "mean, in", "keeps"]
    return markdown_table(headings, rows)


def tau_mutation_table(runs: Sequence[Recorded]) -> str:
    """The two ways to mutate the time constants, trial by trial."""
    chosen = [run for run in runs if run.name in (INTENDED, LISTING)]
    what = ("best distance, in", "its τ_A, s", "population's τ_A, s", "iterations")
    numbers = [_tau_numbers(run) for run in chosen]
    columns = [table.reindex(numbers[0].index) for table in numbers]
    rows = [
        [f"{trial}", *(cell for table in columns for cell in _tau_cells(table.loc[trial]))]
        for trial in columns[0].index
    ]
    means = [cell for table in columns for cell in _tau_cells(table.mean())]
    headings = ["trial", *(f"`{run.name}`: {name}" for run in chosen for name in what)]
    return markdown_table(headings, [*rows, ["**mean**", *means]])


def _tau_numbers(run: Recorded) -> pandas.DataFrame:
    trials = run.trials.index
    tau = [run.record.last_population(trial)["tau_a_s"].mean() for trial in trials]
    columns = run.trials[["distance_in", "tau_a_s", "iterations"]]
    columns.insert(2, "population", pandas.Series(tau, trials))
    return columns


def _tau_cells(row: pandas.Series) -> list[str]:
    return [fixed(value, digits) for value, digits in zip(row, (2, 3, 3, 0), strict=True)]


def engines_table(runs: Sequence[Recorded]) -> str:
    """How far the two engines agree on the gaits that were evaluated on both."""
    headings = ["gaits on both engines", "count", "failed on either", "median difference, in"]
    headings += ["95 % differ by less than, in", f"differ by less than {CLOSE:g} in"]
    rows = []
    for run in runs:
        both = distances_on_both(run.record)
        for what, chosen in (
            ("initial gaits", both[both["iteration"] == 0]),
            ("best gaits", both[both["iteration"] > 0]),
        ):
            if len(chosen.dropna()):
                rows.append([f"`{run.name}`, {what}", *_agreement(chosen)])
    return markdown_table([*headings, "go the same way"], rows)


def _agreement(distances: pandas.DataFrame) -> list[str]:
    both = distances.dropna()
    difference = (both["compiled_in"] - both["drake_in"]).abs()
    same_way = (both["compiled_in"] < 0.0) == (both["drake_in"] < 0.0)
    return [
        f"{len(both)}",
        f"{len(distances) - len(both)}",
        fixed(difference.median(), 3),
        fixed(difference.quantile(0.95)),
        f"{100.0 * (difference < CLOSE).mean():.0f} %",
        f"{100.0 * same_way.mean():.1f} %",
    ]


def _from_to(values: Sequence[float] | pandas.Series) -> str:
    low, high = fixed(min(values)), fixed(max(values))
    return low if low == high else f"{low} to {high}"


TABLES: dict[str, Callable[[Sequence[Recorded]], str]] = {
    "summary": summary_table,
    "comparison": comparison_table,
    "runs": runs_table,
    "best-gaits": best_gaits_table,
    "resimulation": resimulation_table,
    "robustness": robustness_table,
    "robust-gaits": robust_gaits_table,
    "tau-mutation": tau_mutation_table,
    "engines": engines_table,
}


def filled(text: str, make_table: Callable[[str], str]) -> str:
    """The text with every table between its marker lines made again.

    Raises KeyError for an unknown table, ValueError for one without an end.
    """
    lines: list[str] = []
    open_table = None
    for line in text.split("\n"):
        begin = _BEGIN.fullmatch(line.strip())
        if open_table is not None and begin:
            break
        if begin:
            open_table = begin["name"]
            lines += [line, "", make_table(open_table), ""]
        elif open_table is None or line.strip() == _END:
            lines.append(line)
            open_table = None
    if open_table is not None:
        raise ValueError(f"table {open_table} has no line {_END!r} after it")
    return "\n".join(lines)


def main(arguments: Sequence[str]) -> None:
    """Makes the tables of the given Markdown files, or of PAGES, again."""
    runs = load_all()
    for path in [Path(name) for name in arguments] or PAGES:
        text = path.read_text(encoding="utf-8")
        write_whole(path, filled(text, lambda name: TABLES[name](runs)))


if __name__ == "__main__":
    main(sys.argv[1:])
