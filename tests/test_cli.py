"""The commands, as a person meets them."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from tetra_drake.cli import main, make_parser
from tetra_drake.formatting import rounded
from tetra_drake.robot.gait_file import save_gait
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.scenario.load import load_scenario

GIVEN = yaml.safe_load(Path(__file__).with_name("commands.yaml").read_text("utf-8"))


@pytest.fixture
def work(tmp_path, monkeypatch) -> Path:
    """The working folder, with good and bad files and an empty folder."""
    monkeypatch.chdir(tmp_path)
    for name, text in GIVEN["files"].items():
        (tmp_path / name).write_text(text)
    save_gait(seeded_gait(load_scenario()), "good.json", load_scenario())
    (tmp_path / "folder").mkdir()
    return tmp_path


@pytest.fixture
def unchanged(work):
    """The test must leave the working folder as it was."""

    def contents():
        return {path: path.is_file() and path.read_bytes() for path in work.rglob("*")}

    before = contents()
    yield
    assert contents() == before


@pytest.mark.parametrize(("command", "source", "values"), GIVEN["refused"])
def test_wrong_options_and_files_are_refused_in_a_line(command, source, values, unchanged, capsys):
    try:
        status = main(command.split())
    except SystemExit as ended:
        status = ended.code
    captured = capsys.readouterr()
    assert (status, captured.out) == (2, "")
    (line,) = captured.err.splitlines()
    assert line.startswith(f"tetra-drake{source}: ")
    assert all(value in line for value in values.split()), line


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is full")
def test_a_full_disk_behind_the_output_is_told_in_one_line():
    line = [sys.executable, "-m", "tetra_drake", "structure", "prism"]
    with open("/dev/full", "w") as full:
        process = subprocess.run(line, stdout=full, stderr=subprocess.PIPE, text=True, timeout=300)
    assert process.returncode == 1
    assert process.stderr.splitlines()[-1].startswith("tetra-drake: output: ")
    assert "Traceback" not in process.stderr and "Exception" not in process.stderr


def test_a_simulation_that_fails_says_when_and_why_with_status_1(unchanged, capsys):
    assert main(["simulate", "--scenario", "poor.yaml"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "t = 0.0" in line and "100" in line


def help_of(capsys, *command):
    with pytest.raises(SystemExit) as caught:
        main([*command, "--help"])
    assert caught.value.code == 0
    return capsys.readouterr().out.splitlines()


def test_the_help_of_a_command_explains_each_option_and_ends_with_an_example(capsys):
    commands = re.findall(r"^    (\w+)", "\n".join(help_of(capsys)), re.MULTILINE)
    assert {"simulate", "evolve", "structure"} <= set(commands)
    for command in commands:
        *printed, _, example = help_of(capsys, command)
        options = [line for line in printed if line.startswith("  ")]
        unexplained = re.compile(r"  \S+( [^ ]+)?$")  # the explanation may be on the next line
        for line, following in zip(options, [*options[1:], ""], strict=True):
            assert not unexplained.match(line) or following.startswith(12 * " "), line
        marker, program, *arguments = shlex.split(example)
        assert (marker, program, arguments[0]) == ("Example:", "tetra-drake", command)
        make_parser().parse_args(arguments)


def test_simulate_gives_the_same_numbers_of_seed_and_gait_and_replay_the_same_page(work, capsys):
    gait = seeded_gait(load_scenario(), 3)
    save_gait(gait, "gait.json", load_scenario("short.yaml"))
    results, out = [], work / "made" / "when missing"
    for option in ("--seed=3", "--gait=gait.json"):
        assert main(["simulate", "--scenario=short.yaml", option, f"--out={out}"]) == 0
        names = ["replay.html", "result.json", "scenario.yaml", "trajectory.nc"]
        assert sorted(os.listdir(out)) == names
        results.append(json.loads((out / "result.json").read_text()))
        *lines, last = capsys.readouterr().out.splitlines()
        assert ["fitness", rounded(results[-1]["fitness"])] in [line.split()[:2] for line in lines]
        assert last.endswith(str(out / "replay.html"))
    varying = {"wall_time_s": 0.0, "real_time_factor": 0.0}
    assert results[0] | varying == results[1] | varying
    for source in ([str(out)], ["gait.json", "--scenario", "short.yaml"]):
        assert main(["replay", *source, "--out", "sub/again.html"]) == 0
        assert (work / "sub/again.html").read_bytes() == (out / "replay.html").read_bytes()
        assert capsys.readouterr().out.splitlines()[-1].endswith("again.html")


@pytest.mark.parametrize("rate", ["100", "100 Hz", "0.1 kHz"])
def test_a_rate_is_in_hertz_where_it_has_no_unit(rate):
    parsed = make_parser().parse_args(["export", "gait.json", "--rate", rate, "--out", "a"])
    assert parsed.rate == 100.0
