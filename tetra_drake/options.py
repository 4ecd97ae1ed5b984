"""Commands as functions: each parameter of a function is an option of its command.

    Seed = Annotated[int, Option("random seed", metavar="N", type=partial(integer, least=0))]

    def play(gait: File, *, seed: Seed = 0) -> None:

A keyword-only parameter is an option with its name; another parameter is a positional argument. A
parameter without default is required. A positional argument with a default may also be given by its
name, as in --gait FILE. The help of an option is the text of its type, then the text
under `Args:` in the function's docstring.
"""

from __future__ import annotations

import argparse
import contextlib
import inspect
import re
import typing
from collections.abc import Callable, Sequence
from typing import Any, NoReturn

from tetra_drake.settings.refusals import hint
from tetra_drake.settings.units import quantity_to_si

BAD_INPUT = 2  # exit status


class Option:
    """Annotation in the type of a command function's parameter: help and other arguments of
    argparse's add_argument(). Options with the same `group` exclude each other."""

    def __init__(self, help: str = "", *, group: str = "", **arguments: Any) -> None:
        self.arguments = {"help": help, "group": group, **arguments}


class Parser(argparse.ArgumentParser):
    """Parser of a command's options. Its errors are one line."""

    def error(self, message: str) -> NoReturn:
        """Prints an error in one line and ends the process."""
        self.exit(BAD_INPUT, f"{self.prog}: {message}; see {self.prog} --help\n")

    def add_commands(self, functions: Sequence[Callable[..., None]], *, common: Parser) -> None:
        """Adds a command for each function, by its name without an underscore in front. All have
        the options of the parser `common`.

        A function's docstring has four paragraphs: a line for the list of commands, a description,
        `Args:`, and an example. They become the command's help.
        """
        commands = self.add_subparsers(metavar="COMMAND", required=True)
        for function in functions:
            name = function.__name__.removeprefix("_")
            # Without docstrings (python -OO) there is no help.
            text = inspect.getdoc(function) or "\n\n" * 3
            what, description, about, example = text.split("\n\n")
            command = commands.add_parser(
                name,
                help=what.rstrip("."),
                description=description,
                epilog=example,
                parents=[common],
            )
            command.set_defaults(function=function, parser=command)
            texts = dict(re.findall(r"^    (\w+): (.*(?:\n {5,}.*)*)", about, re.M))
            groups: dict[str, Any] = {"": command}
            for parameter in inspect.signature(function, eval_str=True).parameters.values():
                text = " ".join(texts.get(parameter.name, "").split())
                name, group, more = _argument(parameter, text)
                if group not in groups:
                    groups[group] = command.add_mutually_exclusive_group()
                groups[group].add_argument(name, **more)
                if parameter.kind is not parameter.KEYWORD_ONLY and "default" in more:
                    named = {"dest": f"--{name}", "type": more["type"], "help": argparse.SUPPRESS}
                    groups[group].add_argument(f"--{name}", **named)

    def call_of(self, argv: Sequence[str] | None) -> tuple[Callable[..., None], dict[str, Any]]:
        """Parses a command line, by default the process's: returns the function of its command, and
        the values of the command's options by name. Bad options end the process with an error."""
        options, unknown = self.parse_known_args(argv)
        values = vars(options)
        function, parser = values.pop("function"), values.pop("parser")
        # Positional arguments that are given by their names.
        named = {name: values.pop(name) for name in [*values] if name.startswith("--")}
        values |= {name.removeprefix("--"): value for name, value in named.items() if value}
        if unknown:
            names = re.findall(r"--[\w-]+", parser.format_usage())
            parser.error(f"there is no {unknown[0]}; {hint(unknown[0], names)}")
        return function, values


def _argument(parameter: inspect.Parameter, text: str) -> tuple[str, str, dict[str, Any]]:
    """Name of a parameter's option, its group of exclusive options ("" for none), and keyword
    arguments of add_argument(). `text` is added to its help."""
    name, kind, default = parameter.name, parameter.annotation, parameter.default
    more: dict[str, Any] = {"help": "", "group": ""}
    for part in (kind, *typing.get_args(kind)):
        for option in getattr(part, "__metadata__", ()):
            more |= option.arguments
    more["help"] = f"{more['help']} {text}".strip()
    group = more.pop("group")
    is_required = default is parameter.empty
    if not is_required:
        more["default"] = default
    if typing.get_origin(kind) is list:
        more["nargs"] = "+"
    if parameter.kind is not parameter.KEYWORD_ONLY:
        return name, group, more if is_required else more | {"nargs": "?"}
    more |= {"dest": name, "required": is_required}
    if kind is bool:
        more["action"] = "store_false" if default else "store_true"
    return f"--no-{name}" if default is True else f"--{name}", group, more


def integer(text: str, *, least: int) -> int:
    """Reads an integer of at least `least` from the text of an option."""
    if text.isascii() and text.isdecimal() and int(text) >= least:
        return int(text)
    raise argparse.ArgumentTypeError(f"found '{text}', expected an integer, {least} or more")


def size(text: str) -> tuple[int, int]:
    """Width and height in pixels from a text, such as "1920x1080". Both are even."""
    found = re.fullmatch(r"(\d{2,4})x(\d{2,4})", text, re.ASCII)
    width, height = map(int, found.groups()) if found else (0, 0)
    if width not in _PIXELS or height not in _PIXELS:
        limits = f"{_PIXELS[0]} to {_PIXELS[-1]}"
        expected = f"expected two even numbers of {limits}, such as 1920x1080"
        raise argparse.ArgumentTypeError(f"found '{text}', {expected}")
    return width, height


_PIXELS = range(64, 4097, 2)
"""Allowed widths and heights of a picture, in pixels."""


def number(text: str, *, least: float, most: float) -> float:
    """Reads a number between limits from the text of an option."""
    with contextlib.suppress(ValueError):
        if least <= float(text) <= most:
            return float(text)
    raise argparse.ArgumentTypeError(f"found '{text}', expected a number, {least} to {most}")


def quantity(
    unit: str, example: str, *, least: str, most: str, plain: bool = False
) -> Callable[[str], float]:
    """Makes a function that reads a quantity from the text of an option, such as "100 Hz", and
    returns it as a number in the SI unit `unit`. A plain number is refused, unless it is allowed to
    be in this unit. The limits `least` and `most` are texts with units. Errors name the `example`,
    or its unit."""

    def read(text: str) -> float:
        is_plain = re.fullmatch(r"[\d.]+", text)
        if is_plain and plain:
            text = f"{text} {unit}"
        elif is_plain:
            advice = f"did you mean '{text} {example.split()[1]}'?"
            raise argparse.ArgumentTypeError(f"found '{text}' without a unit; {advice}")
        try:
            found = quantity_to_si(text, unit)
        except ValueError as error:
            raise argparse.ArgumentTypeError(f"{error}, such as '{example}'") from error
        if not quantity_to_si(least, unit) <= found <= quantity_to_si(most, unit):
            raise argparse.ArgumentTypeError(f"found '{text}', expected {least} to {most}")
        return found

    return read
