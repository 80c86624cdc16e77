"""Schema files with the groups of columns that they include (schemas/groups.toml) in their places."""

import pathlib
import tomllib

GROUPS = "groups.toml"


def read(file):
    """The contract of one table."""
    schema = tomllib.loads(file.read_text())
    groups = tomllib.loads((file.parent / GROUPS).read_text())
    schema["column"] = [own for entry in schema["column"] for own in columns(entry, groups)]
    return schema


def read_all(folder):
    """The contracts of all tables."""
    return [read(file) for file in sorted(pathlib.Path(folder).glob("*.toml")) if file.name != GROUPS]


def columns(entry, groups):
    if "include" not in entry:
        return [entry]
    in_place = (with_entry(own, entry) for own in groups[entry["include"]])
    return [column for own in in_place for column in columns(own, groups)]


def with_entry(own, entry):
    column = {key: value for key, value in entry.items() if key != "include"}
    for key, value in own.items():
        if isinstance(value, str):
            for part in ["name", "description"]:
                value = value.replace("{" + part + "}", entry.get(part, ""))
            value = value.lstrip("_")
        column[key] = value
    return column
