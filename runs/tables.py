"""The tables of README.md, of the one beside this file and of those of the recorded runs.

    python runs/tables.py [FILE ...]

Each table stands in a Markdown file between two lines:

    <!-- table NAME: made by runs/tables.py -->
    <!-- end -->
"""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas
from analyse import ANALYSIS, LAWS, MUJOCO, TIGHT, Analysis, load_analysis
from record import EXPERIMENTS, PICTURE, TIMES

from tetra_drake.analysis.comparison import compare
from tetra_drake.analysis.robustness import percents
from tetra_drake.errors import InputError
from tetra_drake.evolution.manifest import MANIFEST
from tetra_drake.evolution.run import Run, load_run
from tetra_drake.files import read_text, write_whole
from tetra_drake.formatting import duration, fixed, listed, markdown_table, ranged, signed
from tetra_drake.optimizers.steady_state import CHILDREN
from tetra_drake.report.result_folder import REPLAY
from tetra_drake.results.measures import dominant_frequency
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.signals import signal_samples
from tetra_drake.scenario.metric_units import METRICS
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import INCH, customary

HERE = Path(__file__).parent
README = "README.md"

INTENDED, LISTING, DIAGRAM = RUNS = ("thesis", "thesis-listing", "thesis-drake")
"""The repetitions of the thesis: tau_A mutated as intended, as by the listing, evolved on the
diagram."""
CMA_ES, COULOMB = "cma-es", "coulomb"
"""The first of them with another optimiser, and under another law of friction."""

CLOSE, APART = 0.1, 0.3
"""in: distances on two engines that differ by less agree; where they differ by more, a page says
so."""

OSCILLATOR_TAU_A = 0.3
"""s, the time constant of the thesis's figures of a single oscillator."""

_BEGIN = re.compile(r"<!-- table (?P<name>\S+): made by runs/tables.py -->")
_END = "<!-- end -->"


@dataclass(frozen=True)
class Recorded:
    """A recorded run with its analysis."""

    name: str
    record: Run
    trials: pandas.DataFrame
    """Index: trial. Columns as of the evaluation of its fittest gait, and: iterations,
    evaluations, ended, first_mean and last_mean (mean fitness of the population),
    initial_distance_in (of the fittest initial gait)."""
    analysis: Analysis
    seconds: float
    """What it took to make it; NaN where that is not known."""

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

    def again(self, trial: int, setting: str) -> float:
        """Distance (in) of a trial's fittest gait with a setting of the analysis; NaN without."""
        rows = self.analysis.resimulations.query("trial == @trial and setting == @setting")
        return float(rows["distance_in"].iloc[0]) if len(rows) else math.nan

    def undisturbed(self, trial: int) -> float:
        """Distance (in) of a trial's fittest gait on the compiled engine."""
        return float(self.judged.loc[trial, "undisturbed"]) / INCH

    @property
    def judged(self) -> pandas.DataFrame:
        """What disturbances do to the trials' fittest gaits, in m. Index: trial."""
        return self.analysis.gaits.set_index("gait")


Runs = Mapping[str, Recorded]


def load_recorded(directory: Path) -> Recorded:
    """A recorded run; InputError if it or its analysis is missing, damaged or out of date."""
    run, analysis = load_run(directory), load_analysis(directory)
    best = run.best().set_index("trial")
    if dict(best["index"]) != dict(analysis.best_gaits[["trial", "evaluation"]].to_numpy()):
        problem = f"does not hold the run's best gaits; run `python runs/analyse.py {directory}`"
        raise InputError(directory / ANALYSIS, "best_gaits", problem)
    statuses = pandas.DataFrame(map(vars, run.statuses)).set_index("number")
    trials = best.assign(
        iterations=statuses["iteration"],
        evaluations=statuses["evaluations"],
        ended=statuses["stop"].notna(),
        first_mean=statuses["initial_mean_fitness"],
        last_mean=statuses["mean_fitness"],
        initial_distance_in=statuses["initial_best_distance_in"],
    )
    times = directory.parent / TIMES
    seconds = json.loads(times.read_text(encoding="utf-8")) if times.exists() else {}
    name = directory.name
    return Recorded(name, run, trials, analysis, seconds.get(name, math.nan))


def load_all(directory: Path = HERE) -> dict[str, Recorded]:
    """The recorded runs that are there, by name, in the order of EXPERIMENTS."""
    there = (name for name in EXPERIMENTS if (directory / name / MANIFEST).exists())
    return {name: load_recorded(directory / name) for name in there}


def gallery_table(runs: Runs) -> str:
    """All runs with the distances of their best gaits."""
    headings = ["", "experiment", "distance, in", "on the Drake diagram, in", "keeps"]
    rows = [[*_introduced(run), *_best_distances(run)] for run in runs.values()]
    return markdown_table(headings, rows, text_columns=(0, 1))


def _introduced(run: Recorded) -> list[str]:
    picture = f'<img src="{run.name}/{PICTURE}" width="240" alt="{run.name}">'
    title = f"[`{run.name}`]({run.name}/{README}): {EXPERIMENTS[run.name].title}"
    return [picture, f"{title}<br>[page]({run.name}/{REPLAY})"]


def _best_distances(run: Recorded) -> list[str]:
    best = run.best_trial
    kept = f"{100.0 * run.judged.loc[best, 'kept']:.0f} %"
    return [fixed(run.undisturbed(best)), fixed(run.again(best, TIGHT)), kept]


def effort_table(runs: Runs) -> str:
    """How each run searched, and how long it took to record."""
    rows = [[f"`{name}`", *_search(run), duration(run.seconds)] for name, run in runs.items()]
    total = sum(run.seconds for run in runs.values())
    rows.append(["**all**", "", "", "", "", duration(total)])
    headings = ["experiment", "optimiser", "trials", "evaluations", "failed", "h:mm:ss"]
    return markdown_table(headings, rows, text_columns=(0, 1))


def _search(run: Recorded) -> list[str]:
    evaluations = run.record.evaluations
    failed = int(evaluations["failure"].notna().sum())
    optimizer = run.record.manifest.method.optimizer
    return [optimizer, f"{len(run.trials)}", f"{len(evaluations)}", f"{failed}"]


def trials_table(run: Recorded) -> str:
    """The fittest gait of each trial on all engines and on disturbed robots; below, in which trials
    the engines differ."""
    shown = ("cost_of_transport", "tension", "clearance")
    units = {name: customary(METRICS[name]) for name in shown}
    names = [name.replace("_", " ") + f", {unit}" * bool(unit) for name, (_, unit) in units.items()]
    rows, apart = [], []
    for trial, gait in run.trials.iterrows():
        compiled, tight = run.undisturbed(trial), run.again(trial, TIGHT)
        if not abs(compiled - tight) <= APART:
            apart.append(trial)
        judged = run.judged.loc[trial]
        distances = [compiled, tight, run.again(trial, MUJOCO), judged["mean"] / INCH]
        kept = percents(*judged[["kept", "kept_low", "kept_high"]])
        metrics = [gait[name] / size for name, (size, _) in units.items()]
        counts = [f"{trial}", f"{gait['evaluations']}", fixed(gait["fitness"])]
        rows.append([*counts, *map(fixed, distances), kept, *map(fixed, metrics)])
    headings = ["trial", "evaluations", "fitness", "compiled, in", "diagram, in", "MuJoCo, in"]
    table = markdown_table([*headings, "disturbed, in", "keeps", *names], rows)
    where = f"in trial{'s' * (len(apart) > 1)} {listed(apart)}"
    return table + f"\n\nThe engines differ by more than {APART} in {where}." * bool(apart)


def changes_table(run: Recorded) -> str:
    """What hurts the best gaits most."""
    rows = [[row["what"], *_change_cells(row)] for _, row in run.analysis.changes.iterrows()]
    headings = ["changed by 5 %", "alone: median change (worst), in"]
    return markdown_table([*headings, "rank correlation: mean (median size)"], rows)


def _change_cells(row: pandas.Series) -> list[str]:
    failed = f", {row['failed']:.0f} failed" if row["failed"] else ""
    worst = f"({signed(row['worst'] / INCH)}{failed})"
    ranks = f"{signed(row['correlation'])} ({fixed(row['correlation_size'])})"
    scaled = math.isfinite(row["correlation"])
    return [f"{fixed(row['median'] / INCH)} {worst}", ranks if scaled else "-"]


def laws_table(runs: Runs) -> str:
    """The best gaits evolved under either law of friction, under the other and in MuJoCo."""
    rows, settings = [], [*LAWS, MUJOCO]
    for name, own in zip((INTENDED, COULOMB), LAWS, strict=True):
        run = runs[name]
        again = {s: {trial: run.again(trial, s) for trial in run.trials.index} for s in settings}
        table = pandas.DataFrame(again)
        shares = 100.0 * table.div(table[own], axis=0).median()
        rows.append([f"`{name}`: median", *map(fixed, table.median())])
        rows.append([f"`{name}`: least to most", *map(_from_to, table.T.to_numpy())])
        rows.append([f"`{name}`: median share", *(f"{share:.0f} %" for share in shares)])
    return markdown_table(["best gaits, distance in inches", *settings], rows)


def search_table(runs: Runs) -> str:
    """How well the optimisers search on the thesis's scenario."""
    names = [name for name in (INTENDED, CMA_ES) if name in runs]
    compared = compare([runs[name].record.directory for name in names])
    rows = []
    for name, row in compared.runs.iterrows():
        fitness, distance = (
            row[[f"{what}_{end}" for end in ("mean", "low", "high")]]
            for what in ("fitness", "distance")
        )
        cost = f"{row['reached']:.0f}" if math.isfinite(row["reached"]) else "-"
        there = f"{row['share'] * row['trials']:.0f} of {row['trials']:.0f}"
        ends = [ranged(*fitness), ranged(*distance / INCH)]
        rows.append([f"`{name}`", f"{row['cost']:.0f}", *ends, cost, there])
    headings = ["run", "evaluations of a trial, median", "fitness", "distance, in"]
    reach = f"{fixed((compared.reach or math.nan) / INCH)} in"
    return markdown_table([*headings, f"evaluations to {reach}, median", "trials"], rows)


def comparison_table(runs: Runs) -> str:
    """The thesis's numbers beside those of its repetitions."""
    headings = ["", "thesis", *(f"ours, `{name}`" for name in RUNS)]
    rows = [[what, theirs, *(ours(runs[n]) for n in RUNS)] for what, theirs, ours in COMPARISON]
    return markdown_table(headings, rows)


def summary_table(runs: Runs) -> str:
    """The most important numbers of the thesis's repetition under both laws, for README.md."""
    names = [name for name in (INTENDED, COULOMB) if name in runs]
    headings = [
        "distance in 15 s, inches",
        "thesis",
        *(f"[`{n}`](runs/{n}/{README})" for n in names),
    ]
    rows = [[what, theirs, *(ours(runs[n]) for n in names)] for what, theirs, ours in SUMMARY]
    return markdown_table(headings, rows)


def _iterations(run: Recorded) -> str:
    iterations = run.trials["iterations"]
    return f"{iterations.median():.0f} ({iterations.max()})"


def _seconds_per_iteration(run: Recorded) -> str:
    return f"{CHILDREN * run.record.evaluations['wall_time_s'].median():.2g}"


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
    return fixed(run.again(run.best_trial, TIGHT))


def _fitness_rise(trials: pandas.DataFrame) -> str:
    return f"{fixed(trials['first_mean'].mean())} → {fixed(trials['last_mean'].mean())}"


def _distance_rise(trials: pandas.DataFrame) -> str:
    rise = trials["distance_in"] / trials["initial_distance_in"] - 1.0
    return f"{fixed(100.0 * rise.mean(), 0)} %"


def _off_ground(run: Recorded) -> str:
    shares = run.trials.loc[run.best_trial].filter(regex="^lifted_T")
    return ", ".join(f"{100.0 * share:.0f}" for share in shares) or "-"


def _oscillator_frequency(run: Recorded) -> str:
    """Of a single oscillator with OSCILLATOR_TAU_A, from 5 s on."""
    single = run.scenario.with_changes(
        {"robot.tetrahedra": 2, "cpg.signals": "recorded", "simulation.duration": "15.0 s"}
    )
    gait = Gait("single", weights=(), tau_a=OSCILLATOR_TAU_A, tau_b=2.0 * OSCILLATOR_TAU_A)
    signal = signal_samples(single, gait)[:, 0]
    times = single.cpg.listing_step * np.arange(len(signal))
    return fixed(dominant_frequency(times[times >= 5.0], signal[times >= 5.0]))


def _signal_frequencies(run: Recorded) -> str:
    best = run.analysis.best_gaits.set_index("trial").loc[run.best_trial]
    values = best["frequencies_hz"].values()
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
    ("best of an initial population, mean (range), in", "about 6.6 (one)", _best_initial_per_trial),
    ("initial gaits that go backward", "nearly half", _backward),
    ("best evolved distance, in", "14.34", _best_evolved),
    ("the same gait on the Drake diagram, tight settings, in", "–", _on_diagram),
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
]


def engines_table(runs: Runs) -> str:
    """How far the two engines agree on the gaits that were evaluated on both."""
    headings = ["gaits on both engines", "count", "median difference, in"]
    headings += ["95 % differ by less than, in", f"differ by less than {CLOSE:g} in"]
    rows = []
    if {INTENDED, DIAGRAM} <= {*runs}:
        both = initial_on_both(runs[INTENDED].record, runs[DIAGRAM].record)
        rows.append([f"initial gaits of `{INTENDED}` and `{DIAGRAM}`", *_agreement(both)])
    for run in runs.values():
        both = distances_on_both(run.record)
        if len(both.dropna()):
            rows.append([f"`{run.name}`, best gaits", *_agreement(both)])
    return markdown_table(headings, rows)


def distances_on_both(run: Run) -> pandas.DataFrame:
    """Distances of the gaits that were evaluated again on the Drake diagram.

    Columns: trial, index, compiled_in and drake_in (NaN where a gait failed).
    """
    return _side_by_side(run.evaluations, run.reevaluations)


def initial_on_both(compiled: Run, drake: Run) -> pandas.DataFrame:
    """As distances_on_both, of the random gaits that begin the same trials of two runs."""
    return _side_by_side(compiled.initial(), drake.initial())


def _side_by_side(compiled: pandas.DataFrame, drake: pandas.DataFrame) -> pandas.DataFrame:
    columns = ["trial", "index", "distance_in"]
    first, second = (table.reindex(columns=columns) for table in (compiled, drake))
    both = first.merge(second, on=columns[:2], validate="one_to_one")
    return both.rename(columns={"distance_in_x": "compiled_in", "distance_in_y": "drake_in"})


def _agreement(distances: pandas.DataFrame) -> list[str]:
    both = distances.dropna()
    difference = (both["compiled_in"] - both["drake_in"]).abs()
    return [
        f"{len(both)}",
        fixed(difference.median(), 3),
        fixed(difference.quantile(0.95)),
        f"{100.0 * (difference < CLOSE).mean():.0f} %",
    ]


def _from_to(values: Sequence[float] | pandas.Series) -> str:
    low, high = fixed(min(values)), fixed(max(values))
    return low if low == high else f"{low} to {high}"


TABLES: dict[str, Callable[[Runs], str]] = {
    "summary": summary_table,
    "gallery": gallery_table,
    "effort": effort_table,
    "comparison": comparison_table,
    "engines": engines_table,
    "search": search_table,
    "laws": laws_table,
}
RUN_TABLES: dict[str, Callable[[Recorded], str]] = {
    "trials": trials_table,
    "changes": changes_table,
}
"""Of the run in whose folder the page is."""


def pages(runs: Runs) -> list[Path]:
    """All pages with tables."""
    return [HERE.parent / README, HERE / README, *(HERE / name / README for name in runs)]


def made_again(page: Path, runs: Runs) -> str:
    """The text of a page with its tables made again. Raises InputError if it cannot be read."""

    def table(name: str) -> str:
        return TABLES[name](runs) if name in TABLES else RUN_TABLES[name](runs[page.parent.name])

    return filled(read_text(page, "page"), table)


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
    """Makes the tables of the given Markdown files, or of all pages, again."""
    runs = load_all()
    for page in [Path(name).resolve() for name in arguments] or pages(runs):
        write_whole(page, made_again(page, runs))


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except InputError as error:
        sys.exit(f"tables.py: {error}")
