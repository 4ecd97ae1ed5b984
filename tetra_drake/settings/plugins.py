"""Plug-ins: installed distributions that add kinds, optimisers and structures to this package.

A distribution says what it adds by entry points of these groups:

    tetra_drake.kinds       name: tag of a kind; value: class of its settings
    tetra_drake.optimizers  name: tag of an optimiser; value: class of its settings
    tetra_drake.structures  name: name of a structure; value: module beside the file NAME.yaml

The distributions are searched once, when the first scenario is read. All kinds are imported then.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping
from importlib import metadata
from typing import Any

from tetra_drake import on_demand
from tetra_drake.errors import InputError

KINDS, OPTIMIZERS, STRUCTURES = map("tetra_drake.{}".format, ("kinds", "optimizers", "structures"))
"""Groups of entry points."""

PLUGIN = "plug-in "
"""Beginning of the names of plug-ins among the versions in a record."""


@functools.cache
def entries(group: str) -> Mapping[str, Any]:
    """Entry points (importlib.metadata.EntryPoint) of a group, by name. Raises InputError for a
    name that two plug-ins have, and for metadata of a distribution that cannot be read."""
    found: dict[str, Any] = {}
    try:
        given = [(entry, _title(entry)) for entry in metadata.entry_points(group=group)]
    except Exception as error:  # the metadata of any distribution may be damaged in any way
        raise InputError("plug-ins", group, f"damaged metadata of a package: {error!r}") from error
    for entry, title in given:
        if entry.name in found:
            raise refusal(found[entry.name], f"found it in {title} as well, expected it once")
        found[entry.name] = entry
    return found


def _title(entry: Any) -> str:
    return f"{PLUGIN}{entry.dist.name} {entry.dist.version}"


def loaded(entry: Any) -> Any:
    """Object that an entry point names. Raises InputError, naming the distribution, if it cannot be
    imported."""
    try:
        return entry.load()
    except (Exception, SystemExit) as error:
        cause = f"{type(error).__name__}: {error}"
        raise refusal(entry, f"cannot import {entry.value}: {cause}") from error


def origin(kind: Any) -> str:
    """Tag of a kind, with the plug-in that it is from."""
    added = (*entries(KINDS).values(), *entries(OPTIMIZERS).values())
    titles = [_title(entry) for entry in added if loaded(entry) is type(kind)]
    return ": ".join([*titles, f"!{kind.tag}"])


def part_of(kind: Any, name: str) -> Any:
    """Object in the module of an engine or an optimiser. Raises InputError that names the plug-in,
    if its module has none."""
    try:
        return on_demand.loaded(f"{kind.module}:{name}")
    except (AttributeError, ModuleNotFoundError) as error:
        raise InputError(origin(kind), "module", f"has no {name}: {error}") from error


def refusal(entry: Any, problem: str) -> InputError:
    """Error about an entry point; its source is the distribution with its version."""
    return InputError(_title(entry), f"{entry.group}.{entry.name}", problem)


def plugins_of(sections: Iterable[tuple[str, Any]]) -> dict[str, str]:
    """Versions of the plug-ins whose kinds a scenario uses, by names such as "plug-in x".
    `sections` are the scenario, or pairs of names and sections."""
    kinds = {type(section) for _, section in sections}
    added = [*entries(KINDS).values(), *entries(OPTIMIZERS).values()]
    return {f"{PLUGIN}{x.dist.name}": str(x.dist.version) for x in added if loaded(x) in kinds}


def check_plugins(versions: Mapping[str, str], source: object) -> None:
    """Raises InputError, naming `source`, if a plug-in among the versions of a record is not
    installed. Its version may differ."""
    for name, version in versions.items():
        is_plugin, distribution = name.startswith(PLUGIN), name.removeprefix(PLUGIN)
        if is_plugin and not [*metadata.distributions(name=distribution)]:
            raise InputError(source, "versions", f"needs {name} {version}, which is not installed")
