"""Holds two lakes against each other: the same work done by two builds of posegrid.

    python tests/readers/compare_lakes.py BEFORE AFTER

Files are paired by table, robot and session; of several runs of one session each lake's are taken in the order in which `runs`
names them. A pair is

    bytes    the same bytes;
    values   every value equal to the bit, where a row's run, settings and digests and the schema's version differ;
    differs  anything else: the first differing values are printed.

A column or word that was renamed between the two builds is equal where RENAMED or REWORDED says so. A column that a later version
of the table added (`since` in schemas/*.toml) has no value before and is not compared. Exit code 0: nothing differs and
nothing is missing on either side; 1 otherwise.
"""

import argparse
import os
import pathlib
import re
import sys
from collections import defaultdict

import pyarrow
import pyarrow.parquet

import schemas

# What a run is known by, and what follows from the build: not values of the work.
OF_THE_BUILD = {
    "run", "version", "platform", "cpu_features", "settings", "settings_digest", "table_digests", "replaces",
    "replaced_row_digest", "row_digest", "made_of", "session_runs", "estimate", "grids", "table_id",
}
# Names of columns before -> after, as "table.column".
RENAMED = {
    "parameters.confused_with": "confounded_with",
    "drift.suspect": "hypothesis",
}
# Words before -> words after, as patterns, in every text of these columns: whole words, or keys and words inside JSON.
REWORDED = {
    "angles": [(r"^blended$", "weighted")],
    "corrected_by": [(r"^blended$", "weighted")],
    "identifiability": [(r"^told_apart$", "identifiable")],
    "quantity": [(r"^blend$", "command_weight")],
    "parameter": [(r"^blend_(\d+)$", r"command_weight_\1")],
    "confused_with": [(r"^blend_(\d+)$", r"command_weight_\1")],
    "parts": [(r"^command_blend$", "command_weight")],
    "model": [
        (r"\bsession_blend_sd\b", "session_command_weight_sd"),
        (r"\bblend_sd\b", "command_weight_sd"),
        (r"\b(session_|own_)?blend\b", r"\1command_weight"),
        (r"\bstop_short\b", "approach_offset"),
        (r"\bstop_short_sd_rad\b", "approach_offset_sd_rad"),
        (r'"standing"', '"approach"'),
    ],
}


SCHEMAS = pathlib.Path(__file__).parents[2] / "schemas"


def added(table, before):
    """The columns that versions of a table after that of the file `before` added."""
    schema = SCHEMAS / f"{table}.toml"
    stated = (before.schema.metadata or {}).get(b"posegrid.schema_version")
    if not stated or not schema.is_file():
        return set()
    columns = schemas.read(schema)["column"]
    return {column["name"] for column in columns if column.get("since", 0) > int(stated)}


def files(lake):
    """Published files of a lake by table, robot and session, in the order of their runs' names; pages too, but not asked, which has a clock."""
    found = defaultdict(list)
    for path in sorted(lake.rglob("*")):
        if path.is_file() and path.suffix in {".parquet", ".html"} and not any(
            part.startswith((".", "_")) or part == "asked" for part in path.relative_to(lake).parts
        ):
            inside = path.relative_to(lake)
            found[inside.parts[:-1]].append(path)
    return found


def without_run(text):
    """A page without what names its run and build: hexadecimal names, digests and the version."""
    return re.sub(r"\b[0-9a-f]{8,64}\b|(?<=posegrid )\d+\.\d+\.\d+|(?<=>)\d+\.\d+\.\d+(?=</dd>)", "#", text)


def column_after(table, name):
    return RENAMED.get(f"{table}.{name}", name)


def words_after(column, value):
    if isinstance(value, list):
        return [words_after(column, v) for v in value]
    if isinstance(value, str):
        for before, after in REWORDED.get(column, ()):
            value = re.sub(before, after, value)
    return value


def bits(value):
    """A value such that two are equal when they are equal to the bit: NaN to itself, 0.0 not to -0.0."""
    if isinstance(value, float):
        return value.hex()
    if isinstance(value, list):
        return [bits(v) for v in value]
    return value


def differences(table, before, after):
    """What differs between two Parquet files of one table, as sentences."""
    before, after = (pyarrow.parquet.read_table(path) for path in (before, after))
    if before.num_rows != after.num_rows:
        yield f"{before.num_rows} rows before, {after.num_rows} after"
        return
    names = {column_after(table, name): name for name in before.column_names}
    for name in sorted((names.keys() ^ set(after.column_names)) - added(table, before)):
        yield f"column {name} is only {'before' if name in names else 'after'}"
    for new, old in names.items():
        if new not in after.column_names or old in OF_THE_BUILD:
            continue
        if before.schema.field(old).type != after.schema.field(new).type:
            yield f"column {new}: {before.schema.field(old).type} before, {after.schema.field(new).type} after"
            continue
        pairs = zip(before[old].to_pylist(), after[new].to_pylist(), strict=True)
        wrong = [
            (row, was, now)
            for row, (was, now) in enumerate(pairs)
            if bits(words_after(old, was)) != bits(now)
        ]
        if wrong:
            row, was, now = wrong[0]
            was, now = short(was, now), short(now, was)
            yield f"column {new}: {len(wrong)} of {before.num_rows} values, the first in row {row}: {was!r} before, {now!r} after"


def short(value, other):
    """A long text from shortly before where it differs from the other."""
    if not isinstance(value, str) or not isinstance(other, str) or len(value) < 200:
        return value
    same = len(os.path.commonprefix([value, other]))
    return f"…{value[max(0, same - 40):same + 80]}…"


def compare(table, before, after):
    """`bytes`, `values` or `differs` for a pair of files, and what differs."""
    if before.read_bytes() == after.read_bytes():
        return "bytes", []
    if before.suffix == ".html":
        same = without_run(before.read_text()) == without_run(after.read_text())
        return ("values", []) if same else ("differs", ["the page's text"])
    found = list(differences(table, before, after))
    return ("differs" if found else "values"), found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", type=pathlib.Path, help="the lake that the earlier build wrote")
    parser.add_argument("after", type=pathlib.Path, help="the lake that the later build wrote")
    arguments = parser.parse_args()
    before, after = files(arguments.before), files(arguments.after)
    counts = defaultdict(int)
    for folder in sorted(before.keys() | after.keys()):
        name = "/".join(folder)
        pair = before.get(folder, []), after.get(folder, [])
        if len(pair[0]) != len(pair[1]):
            counts["missing"] += 1
            print(f"missing {name}: {len(pair[0])} files before, {len(pair[1])} after")
            continue
        for was, now in zip(*pair, strict=True):
            verdict, found = compare(folder[0], was, now)
            counts[verdict] += 1
            if verdict != "bytes":
                print(f"{verdict:8}{now.relative_to(arguments.after)}", *found, sep="\n        ")
    print(", ".join(f"{counts[kind]} {kind}" for kind in ("bytes", "values", "differs", "missing")))
    if not counts["bytes"] + counts["values"]:
        sys.exit("nothing to compare: are these lakes?")
    sys.exit(1 if counts["differs"] + counts["missing"] else 0)


if __name__ == "__main__":
    main()
