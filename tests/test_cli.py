"""The commands, as a person meets them."""

import contextlib
import io
import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from tetra_drake.cli import main, make_parser
from tetra_drake.formatting import rounded
from tetra_drake.robot.gait import Gait, save_gait, seeded_gait
from tetra_drake.scenario.load import load_scenario

SHORT = """\
base: thesis
name: short
simulation: {duration: 0.3 s, steady_from: 0.1 s, sample_period: 70 ms}
"""
"""The sample period does not divide the duration."""

GOOD = seeded_gait(load_scenario()).to_json(load_scenario()) | {"name": "good"}
FILES = {
    "good.json": json.dumps(GOOD),
    "short.yaml": SHORT,
    "key.yaml": "base: thesis\nrobot: {tetrahedron: 4}\n",
    "poor.yaml": SHORT.replace("{", "{max_evaluations: 100, "),
}


@pytest.fixture
def work(tmp_path, monkeypatch) -> Path:
    """The working folder, with good and bad files and an empty folder."""
    monkeypatch.chdir(tmp_path)
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
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


def refusal(command, capsys):
    """The line by which a command is refused."""
    try:
        status = main(command.split())
    except SystemExit as ended:
        status = ended.code
    captured = capsys.readouterr()
    assert (status, captured.out) == (2, "")
    (line,) = captured.err.splitlines()
    return line


@pytest.mark.parametrize(
    ("command", "source", "values"),
    [
        ("", ": COMMAND", ""),
        ("simulate --seed 1 --gait good.json", " simulate", "--gait --seed"),
        ("simulate --sceanrio thesis", " simulate", "--sceanrio '--scenario'?"),
        ("figures a --width 3.4", " figures", "--width '3.4' '3.4 in'"),
        ("simulate --scenario key.yaml", ": key.yaml", "robot.tetrahedron tetrahedra"),
        ("simulate --engine compiled --meshcat", ": scenario thesis", "engine compiled"),
        ("simulate --scenario short.yaml --out good.json", ": good.json", ""),
        ("structure six_baer", ": six_baer", "'six_bar'?"),
    ],
)
def test_wrong_options_and_files_are_refused_in_one_line(
    command, source, values, unchanged, capsys
):
    line = refusal(command, capsys)
    assert line.startswith(f"tetra-drake{source}: ")
    assert all(value in line for value in values.split()), line


@pytest.mark.parametrize(
    "command",
    [
        "simulate --scenario short.yaml --out",
        "simulate --gait",
        "simulate --command",
        "simulate --scenario",
        "export --scenario short.yaml --out",
        "evolve --scenario quick --out",
        "replay --out a.html",
        "replay good.json --out",
        "figures",
        "fit",
        "cpg --out",
        "structure",
    ],
)
def test_a_name_that_no_file_can_have_is_refused_in_one_line(command, unchanged, capsys):
    # Messages have no control characters.
    assert refusal(f"{command} b\0", capsys).startswith(r"tetra-drake: b\x00: ")


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


@pytest.fixture(scope="module")
def simulated(tmp_path_factory) -> tuple[Path, str]:
    """The folder and the printed text of one short simulation."""
    out = tmp_path_factory.mktemp("simulated") / "made" / "when missing"
    short = out.parents[1] / "short.yaml"
    short.write_text(SHORT)
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        assert main(["simulate", "--scenario", str(short), "--seed=3", "--out", str(out)]) == 0
    return out, printed.getvalue()


@pytest.fixture(scope="module")
def result(simulated) -> dict:
    return json.loads((simulated[0] / "result.json").read_text())


@pytest.fixture(scope="module")
def gait_3() -> Gait:
    return seeded_gait(load_scenario(), 3)


def test_simulate_writes_its_files_and_prints_the_fitness_and_the_page(simulated, result):
    folder, printed = simulated
    names = ["replay.html", "result.json", "scenario.yaml", "trajectory.nc"]
    assert sorted(os.listdir(folder)) == names
    lines = printed.splitlines()
    fitness = next(line.split() for line in lines if line.startswith("fitness "))
    assert fitness[1] == rounded(result["fitness"])
    assert lines[-1].endswith(str(folder / "replay.html"))


def test_a_gait_file_gives_the_numbers_of_the_seed_it_was_drawn_with(work, gait_3, result, capsys):
    save_gait(gait_3, "gait.json", load_scenario("short.yaml"))
    assert main(["simulate", "--scenario", "short.yaml", "--gait", "gait.json"]) == 0
    assert capsys.readouterr().err == ""
    again = json.loads(Path("out/result.json").read_text())  # the default folder
    varying = {"wall_time_s": 0.0, "real_time_factor": 0.0}
    assert again | varying == result | varying


def test_replay_makes_the_page_of_simulate_from_recording_or_gait(simulated, work, gait_3, capsys):
    save_gait(gait_3, "gait.json", load_scenario("short.yaml"))
    for source in ([str(simulated[0])], ["gait.json", "--scenario", "short.yaml"]):
        assert main(["replay", *source, "--out", "sub/again.html"]) == 0
        page = (work / "sub/again.html").read_bytes()
        assert page == (simulated[0] / "replay.html").read_bytes()
        assert capsys.readouterr().out.splitlines()[-1].endswith("again.html")
