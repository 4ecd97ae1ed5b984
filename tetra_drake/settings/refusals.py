"""One-line error messages about wrong settings."""

from __future__ import annotations

import difflib
import functools
import itertools
import re
import textwrap
from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, NoReturn

from tetra_drake.errors import InputError
from tetra_drake.settings.units import plainest

if TYPE_CHECKING:
    from pydantic import BaseModel, ValidationError
    from pydantic_core import ErrorDetails

Tree = dict[str, Any]

TAG = "_tag"
"""Key in a parsed mapping that holds its YAML tag, such as "Coulomb" for `!Coulomb`."""

_LONGEST_LIST = 200
"""Largest number of characters of a list of names in a message."""

_MOST_NAMES, _LONGEST_NAME = 2000, 100
"""Limits of the search for similar names, because it is slow: number of names, and characters."""


def refuse(key: str, problem: str) -> NoReturn:
    """Raises an InputError from a pydantic validator. `key` is relative to the validated
    section."""
    raise InputError("", key, problem)


def input_error(
    error: ValidationError, section: type[BaseModel], tree: Any, source: object, key: str = ""
) -> InputError:
    """Converts pydantic's error to an InputError that names `source`, such as a file, and key.

    `section` is the class that refused its content `tree`. `key` is the dotted key of the section
    in `source`; the error's key is appended to it.
    """
    # An unknown key tells why another is missing. A value that fits no member of a union has an
    # error per member: the innermost tells most, then one that is not about the type.
    first = max(
        error.errors(include_url=False),
        key=lambda one: (one["type"] in _UNKNOWN, len(one["loc"]), "_type" not in one["type"]),
    )
    is_unknown, name = first["type"] in _UNKNOWN, str(first["loc"][-1]) if first["loc"] else ""
    schema = _schema_of(section)
    members = kinds = [schema]
    siblings, own = Tree(), ""
    # The place also contains tags and names of union members, which are no keys.
    for part in first["loc"][:-1] if is_unknown else first["loc"]:
        if isinstance(tree, list) and isinstance(part, int):
            key, tree = joined(key, f"[{part}]"), tree[part]
        elif isinstance(tree, dict) and part in tree:
            siblings, own = tree, str(part)
            key, tree = joined(key, own), tree[part]
        inner = _inner(part, members, schema)
        if inner is not members:
            members, kinds = inner, members if len(members) > 1 else inner
    if is_unknown and name != TAG:
        # Perhaps a kind or an inner section has the key.
        meant = [kind["title"] for kind in kinds if "title" in kind and name in kind["properties"]]
        inner_keys = [inner for member in members for inner, _ in keys_in(member, schema)]
        meant += [f"'{inner}'" for inner in inner_keys if inner.endswith(f".{name}")]
        known = [own for one in members for own in one.get("properties", {}) if own != name]
        advice = (
            f"did you mean {' or '.join(dict.fromkeys(meant))}?" if meant else hint(name, known)
        )
        return InputError(source, joined(key, name), f"unknown key; {advice}")
    inner_key, problem = _in_words(first, tree, members)
    if first["type"] == "missing" and "base" in schema["properties"]:
        whole = f", as !{tree[TAG]} replaces a base's kind" if TAG in (tree or {}) else ""
        problem += whole or ", or name a `base` that has it"
        # Perhaps a name of a map is misspelt.
        given = {name: x for name, x in siblings.items() if isinstance(x, dict) and inner_key in x}
        if close := difflib.get_close_matches(own, given, n=1):
            problem += f"; did you mean '{close[0]}'?"
    return InputError(source, joined(key, inner_key), problem)


@functools.cache
def _schema_of(section: type[BaseModel]) -> Tree:
    """JSON Schema of a section. It takes 0.1 s to make for a scenario."""
    return section.model_json_schema()


_UNKNOWN = "extra_forbidden", "invalid_key"
"""Types of pydantic's errors about unknown keys."""


def members_of(node: Tree, schema: Tree) -> list[Tree]:
    """Alternative types that a node of a JSON Schema allows: members of its union (anyOf), or its
    only type. A reference to a section is replaced by the section's schema, from the definitions
    ($defs) of the whole `schema`."""
    sections = {"": {}} | schema.get("$defs", {})
    members = node.get("anyOf", [node])
    members = [inner for one in members for inner in one.get("anyOf", [one])]
    return [sections[one.get("$ref", "").rpartition("/")[2]] | one for one in members]


def keys_in(section: Tree, schema: Tree, key: str = "") -> Iterator[tuple[str, Tree]]:
    """Dotted keys of a section, nested ones included, each with the JSON Schema of its value.

    `section` is the section's part of the whole `schema`. `key` is put before all keys. NAME in a
    key stands for a name that the user chooses.
    """
    for name, node in section.get("properties", {}).items():
        item = node.get("additionalProperties")
        inner = joined(key, f"{name}.NAME" if item else name)
        yield inner, node
        for member in members_of(item or node, schema):
            if "$ref" in member:
                yield from keys_in(member, schema, inner)


def _inner(part: str | int, members: list[Tree], schema: Tree) -> list[Tree]:
    """JSON Schemas of the types that an item of a value may have, in a list.

    `members` are the types that the value itself may have; `schema` is the whole JSON Schema.
    `part` is the key or index of the item. If `part` is a tag, the result is the one of `members`
    with this tag. If it is neither a tag, key nor index, the result is `members`.
    """
    for member in members:
        if member.get("title") == f"!{part}":
            return [member]
    for member in members:
        item = member.get("properties", {}).get(part, member.get("additionalProperties"))
        if inner := member.get("items") if isinstance(part, int) else item:
            return members_of(inner, schema)
    return members


def _in_words(error: ErrorDetails, value: Any, members: list[Tree]) -> tuple[str, str]:
    """Key and problem in words, for one of pydantic's errors about `value`. The key is relative to
    the value, and "" if the value itself is wrong. `members` are the types that the value may have,
    from the JSON Schema."""
    kind, context, found = error["type"], error.get("ctx", {}), f"found {described(value)}"
    if kind == "value_error":
        cause = context["error"]
        return getattr(cause, "key", ""), getattr(cause, "problem", str(cause))
    if kind == "missing":
        return str(error["loc"][-1]), "is missing; give it"
    if kind == "list_type":
        return "", f"{found}, expected a list" + (f", [{value}]" if isinstance(value, str) else "")
    if kind.startswith("union_tag"):
        tags = [one["title"] for one in members if "title" in one]
        known = f"expected {' or '.join(tags)}; a plug-in may be missing"
        return "", f"{found}; {known if isinstance(value, dict) else hint(found, tags)}"
    expected = re.sub(".* should (be|have) ", "", error["msg"]).replace(" after validation", "")
    expected = re.sub("(a valid dict|Extra inputs).*", "a mapping of keys", expected)
    unit = next((member["unit"] for member in members if "unit" in member), "")
    for limit in {"gt", "ge", "lt", "le"} & context.keys():
        expected = f"{expected.rpartition(' ')[0]} {plainest(context[limit], unit)}"
    return "", f"{found}, expected {expected}"


def joined(key: str, inner: str) -> str:
    """Dotted key of an inner key: "robot" and "gravity" give "robot.gravity", "pairs" and "[0]"
    give "pairs[0]"."""
    return f"{key}{inner}" if inner.startswith("[") else f"{key}.{inner}".strip(".")


def described(value: Any) -> str:
    """Description of a value for a message, such as "a list" or "!Coulomb"."""
    if isinstance(value, dict):
        return f"!{value[TAG]}" if TAG in value else "a mapping"
    if value is None:
        return "nothing"
    if isinstance(value, list):
        return "a list"
    if isinstance(value, bool):
        return str(value).lower()
    return f"'{value}'" if isinstance(value, str) else str(value)[:40]


def hint(name: Any, names: Iterable[str]) -> str:
    """Advice about a misspelt name: the most similar name, or all names."""
    names = list(itertools.islice(names, _MOST_NAMES))
    close = difflib.get_close_matches(str(name)[:_LONGEST_NAME], names, n=1)
    if close:
        return f"did you mean '{close[0]}'?"
    listed = textwrap.shorten(", ".join(names), _LONGEST_LIST, placeholder=" ...")
    return f"expected one of {listed}" if names else "expected none"


def check_known(key: str, what: str, name: str, known: Collection[str]) -> None:
    """Raises an InputError from a pydantic validator for a `name` that is none of the `known` ones.
    `what` is what it names, such as "node". For `key` see refuse()."""
    if name not in known:
        refuse(key, f"found unknown {what} '{name}'; {hint(name, known)}")


def no_such(what: str, name: str, shipped: Sequence[str]) -> str:
    """Error text with advice, for a `name` that is neither a file nor one of the names `shipped`
    with the package. `what` is a kind of file, such as "scenario file"."""
    return f"no such {what}; {hint(name.rpartition('/')[2], shipped)}"
