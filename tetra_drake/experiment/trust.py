"""The tables a reader needs before trusting a number of the experiment, as Markdown."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tetra_drake.evolution.population import last_population
from tetra_drake.evolution.progress import duration
from tetra_drake.evolution.record import SCENARIO
from tetra_drake.experiment.engines import Agreement, agreement, evolved_distances
from tetra_drake.experiment.engines import initial_distances as initial_on_both
from tetra_drake.experiment.markdown import fixed, markdown_table, signed
from tetra_drake.experiment.recorded import INTENDED, LISTING, Experiment, RecordedRun
from tetra_drake.experiment.variations import DEFAULT, NOTHING

if TYPE_CHECKING:
    import pandas


def runs_table(experiment: Experiment) -> str:
    """What the runs are, and the command that makes each again."""
    columns = [_run_facts(run) for run in experiment.values()]
    rows = [[name, *(facts[name] for facts in columns)] for name in columns[0]]
    headings = ["", *(f"`{name}`" for name in experiment)]
    return markdown_table(headings, rows, text_columns=range(len(headings)))


def best_gaits_table(experiment: Experiment) -> str:
    """The best gait of each trial: how far it goes, its time constant, what it is like."""
    rows = []
    tetrahedra: list[str] = []
    for run in experiment.values():
        walks = run.analysis.best_gaits.set_index("trial")
        for trial, gait in run.best.iterrows():
            off, hertz = walks.loc[trial, "off_ground"], walks.loc[trial, "frequencies_hz"]
            tetrahedra = list(off)
            shares = [f"{100.0 * share:.0f}" for share in off.values()]
            swings = [value for value in hertz.values() if value is not None]
            rows.append(
                [
                    f"`{run.name}`, trial {trial}",
                    fixed(gait["distance_in"]),
                    fixed(gait["tau_a_s"], 3),
                    _from_to(min(swings), max(swings)) if swings else "-",
                    *shares,
                ]
            )
    lifted = [f"{name} lifted, %" for name in tetrahedra]
    return markdown_table(["best gait", "distance, in", "τ_A, s", "signals, Hz", *lifted], rows)


def resimulation_table(experiment: Experiment) -> str:
    """The best gait of each trial on the Drake diagram, integrated in other ways.

    Below each run, the absolute difference from the default settings, median and greatest.
    """
    rows = []
    settings: list[str] = []
    for run in experiment.values():
        again = run.analysis.resimulations
        settings = list(dict.fromkeys(again["setting"]))
        table = again.pivot(index="trial", columns="setting", values="distance_in")[settings]
        for trial, distances in table.iterrows():
            recorded = run.best.loc[trial, "distance_in"]
            cells = [fixed(value) for value in distances]
            rows.append([f"`{run.name}`, trial {trial}", fixed(recorded), *cells])
        table.insert(0, "recorded", run.best["distance_in"])
        differences = table.sub(table[DEFAULT], axis=0).abs()
        for name, values in (("median", differences.median()), ("greatest", differences.max())):
            cells = ["" if key == DEFAULT else fixed(value) for key, value in values.items()]
            rows.append([f"*`{run.name}`: {name} difference*", *cells])
    return markdown_table(["best gait", "as recorded", *settings], rows)


def robustness_table(experiment: Experiment) -> str:
    """By how much distances change (in) when robot or surroundings are a few percent off.

    For each run of several trials, over their best gaits and both signs: median of the absolute
    change, and in brackets the range of the change.
    """
    runs = [run for run in experiment.values() if len(run.best) > 1] or [*experiment.values()]
    changes = {run.name: _changes(run) for run in runs}
    first = next(iter(changes.values()))
    percents = sorted(first["percent"].unique())
    rows = []
    for what in dict.fromkeys(first["what"]):
        cells = []
        for table in changes.values():
            of_kind = table[table["what"] == what]
            cells += [_spread(of_kind[of_kind["percent"] == percent]) for percent in percents]
        rows.append([what, *cells])
    headings = [f"`{name}`, ± {percent:g} %" for name in changes for percent in percents]
    return markdown_table(["what is off", *headings], rows)


def robust_gaits_table(experiment: Experiment) -> str:
    """How each trial's best gait takes it that robot or surroundings are a few percent off.

    For each percentage, over all that is off and both signs: median of the absolute change of
    the distance (in) with the range of the change, and how often the gait loses over 10 %.
    """
    rows = []
    percents: list[float] = []
    for run in experiment.values():
        changes = _changes(run)
        percents = sorted(changes["percent"].unique())
        for trial, of_gait in changes.groupby("trial"):
            cells = []
            for percent in percents:
                chosen = of_gait[of_gait["percent"] == percent]
                cells += [_spread(chosen), f"{100.0 * _share_lost(chosen):.0f} %"]
            distance = fixed(run.best.loc[trial, "distance_in"])
            rows.append([f"`{run.name}`, trial {trial}", distance, *cells])
    headings = [
        f"± {percent:g} %: {what}"
        for percent in percents
        for what in ("change, in", "loses over 10 %")
    ]
    return markdown_table(["best gait", "distance, in", *headings], rows)


def tau_mutation_table(experiment: Experiment) -> str:
    """The two ways to mutate the time constants, trial by trial."""
    runs = [experiment[name] for name in (INTENDED, LISTING) if name in experiment]
    trials = sorted({int(trial) for run in runs for trial in run.best.index})
    rows = [
        [f"{trial}", *(cell for run in runs for cell in _tau_cells(run, trial))] for trial in trials
    ]
    rows.append(["**mean**", *(cell for run in runs for cell in _tau_means(run))])
    headings = [
        f"`{run.name}`: {what}"
        for run in runs
        for what in ("best distance, in", "its τ_A, s", "population's τ_A, s", "iterations")
    ]
    return markdown_table(["trial", *headings], rows)


def engines_table(experiment: Experiment) -> str:
    """How far the two engines agree on gaits that were evaluated on both."""
    rows = []
    for run in experiment.values():
        for what, distances in (
            ("initial gaits", initial_on_both(run.tables)),
            ("best gaits", evolved_distances(run.tables)),
        ):
            if len(distances.dropna()):
                rows.append([f"`{run.name}`, {what}", *_agreement_cells(agreement(distances))])
    if not rows:
        return "No gait was evaluated on both engines."
    headings = [
        "gaits on both engines",
        "count",
        "failed on either",
        "median difference, in",
        "95 % differ by less than, in",
        "differ by less than 0.1 in",
        "go the same way",
    ]
    return markdown_table(headings, rows)


def _run_facts(run: RecordedRun) -> dict[str, str]:
    manifest, evaluations = run.tables.manifest, run.tables.evaluations
    ended = sum(status.stop is not None for status in run.statuses)
    return {
        "engine": run.scenario.simulation.engine,
        "mutation of the time constants": run.scenario.evolution.tau_mutation,
        "trials": f"{run.scenario.evolution.trials}, {ended} of them ended",
        "seed": f"{manifest.seed}",
        "evaluations": f"{len(evaluations)}",
        "of which failed": f"{int(evaluations['failure'].notna().sum())}",
        "simulation took (h:mm:ss)": duration(float(evaluations["wall_time_s"].sum())),
        "evaluated again on the Drake diagram": f"{len(run.tables.reevaluations)}",
        "versions": ", ".join(f"{name} {number}" for name, number in manifest.versions.items()),
        "makes it again": f"`tetra-drake evolve --scenario runs/{run.name}/{SCENARIO} "
        f"--seed {manifest.seed} --out again`",
    }


def _agreement_cells(found: Agreement) -> list[str]:
    return [
        f"{found.gaits}",
        f"{found.failed}",
        fixed(found.median_in, 3),
        fixed(found.percentile_95_in, 2),
        f"{100.0 * found.share_close:.0f} %",
        f"{100.0 * found.share_direction:.1f} %",
    ]


def _changes(run: RecordedRun) -> pandas.DataFrame:
    """The variations with `unchanged_in` and `change_in`, and percents without their signs."""
    table = run.analysis.variations
    unchanged = table[table["what"] == NOTHING].set_index("trial")["distance_in"]
    changed = table[table["what"] != NOTHING]
    unchanged_in = changed["trial"].map(unchanged)
    return changed.assign(
        unchanged_in=unchanged_in,
        change_in=changed["distance_in"] - unchanged_in,
        percent=changed["percent"].abs(),
    )


def _spread(changes: pandas.DataFrame) -> str:
    values = changes["change_in"].dropna()
    failed = len(changes) - len(values)
    note = f", {failed} failed" if failed else ""
    if values.empty:
        return f"-{note}"
    ends = f"{signed(values.min())} to {signed(values.max())}"
    return f"{fixed(values.abs().median())} ({ends}{note})"


def _share_lost(changes: pandas.DataFrame) -> float:
    """How often a tenth of the distance or more is lost, or the simulation fails."""
    kept = changes["change_in"] > -0.1 * changes["unchanged_in"].abs()
    return float((~kept).mean())


def _population_tau(run: RecordedRun, trial: int) -> float:
    evaluations = run.tables.evaluations
    population = last_population(evaluations[evaluations["trial"] == trial])
    return float(population["tau_a_s"].mean())


def _tau_cells(run: RecordedRun, trial: int) -> list[str]:
    if trial not in run.best.index:
        return ["-"] * 4
    best = run.best.loc[trial]
    status = next(status for status in run.statuses if status.number == trial)
    return [
        fixed(best["distance_in"]),
        fixed(best["tau_a_s"], 3),
        fixed(_population_tau(run, trial), 3),
        f"{status.iteration}" + ("" if status.stop else ", goes on"),
    ]


def _tau_means(run: RecordedRun) -> list[str]:
    populations = [_population_tau(run, int(trial)) for trial in run.best.index]
    return [
        fixed(run.best["distance_in"].mean()),
        fixed(run.best["tau_a_s"].mean(), 3),
        fixed(float(np.mean(populations)), 3),
        f"{np.mean([status.iteration for status in run.statuses]):.0f}",
    ]


def _from_to(low: float, high: float) -> str:
    return fixed(low) if fixed(low) == fixed(high) else f"{fixed(low)} to {fixed(high)}"
