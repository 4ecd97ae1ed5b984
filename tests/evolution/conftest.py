"""What the tests of records and runs start from."""

from concurrent.futures import ThreadPoolExecutor

import pytest
from helpers.analytic import Bowl, small_scenario

from tetra_drake.evolution.run_record import RunRecord
from tetra_drake.evolution.trials import open_trials, run_trials


@pytest.fixture
def run_small(tmp_path):
    """run_small(name, ...): a small run in threads; its directory."""

    def run(name="run", *, seed=5, workers=2, evaluate=None, resume=False, changes=None, **options):
        directory = tmp_path / name
        if resume:
            record = RunRecord.resume(directory)
        else:
            scenario = small_scenario(**options).with_changes(changes or {})
            record = RunRecord.create(directory, scenario=scenario, seed=seed)
        with record:
            run_trials(
                open_trials(record),
                evaluate=evaluate or Bowl(),
                workers=workers,
                executor=ThreadPoolExecutor,
            )
        return directory

    return run
