"""Tables of measured values in every form, and what other programs read in them.

    python tests/readers/measured_tables.py STATIONS FOLDER

For each table of the folder STATIONS, this writes into FOLDER the table in every form that posegrid reads, by pandas, openpyxl,
PyYAML and json, and beside each file NAME.expected: a line of the columns' names, then a line for each row, separated by
tabs. Numbers are hexadecimal, so that they are compared to the last bit; an empty cell is a blank. What is expected is read back
from the written file by the same packages, which know nothing of posegrid.
"""

import csv
import json
import sys
import warnings
from pathlib import Path

import pandas
import yaml


def number(value):
    """What a cell holds: a number, a text, or None for a blank."""
    if value is None or value == "" or value != value:
        return None
    return float(value) if isinstance(value, (int, float)) else value


def flat(value, name=""):
    """The values inside a value, each with its name."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from flat(inner, f"{name}.{key}" if name else str(key))
    elif isinstance(value, (list, tuple)):
        for index, inner in enumerate(value):
            yield from flat(inner, f"{name}[{index}]")
    elif hasattr(value, "tolist") and not isinstance(value, (int, float)):
        yield from flat(value.tolist(), name)
    else:
        yield name, number(value)


def of_records(records):
    """Names and rows of a list of nested records."""
    rows = [dict(flat(record)) for record in records]
    names = list(dict.fromkeys(name for row in rows for name in row))
    return names, [[row.get(name) for name in names] for row in rows]


def of_keyed(keyed):
    """Records whose key is a column; keys are numbers here."""
    return of_records([{"key": float(key), **record} for key, record in keyed.items()])


def of_text(path, separator, decimal, encoding="utf-8"):
    with open(path, newline="", encoding=encoding) as file:
        names, *rows = csv.reader(file, delimiter=separator)
    read = lambda cell: None if cell == "" else float(cell.replace(decimal, "."))
    return names, [[read(cell) for cell in row] for row in rows]


def of_frame(frame):
    return of_records(frame.to_dict("records"))


def expect(path, table):
    names, rows = table
    written = lambda value: "" if value is None else value.hex() if isinstance(value, float) else value
    lines = [names] + [[written(cell) for cell in row] for row in rows]
    text = "".join("\t".join(line) + "\n" for line in lines)
    Path(f"{path}.expected").write_text(text, encoding="utf-8")


def flat_forms(folder, name, table):
    """A table of plain columns, in every form."""
    names, rows = table
    records = [dict(zip(names, row)) for row in rows]
    frame = pandas.DataFrame(records, columns=names)
    at = lambda ending: folder / f"{name}{ending}"
    frame.to_csv(at(".tsv"), sep="\t", index=False)
    expect(at(".tsv"), of_text(at(".tsv"), "\t", "."))
    frame.to_csv(at(".utf16.csv"), index=False, encoding="utf-16")
    expect(at(".utf16.csv"), of_text(at(".utf16.csv"), ",", ".", "utf-16"))
    frame.to_csv(at(".bar.txt"), sep="|", decimal=",", index=False, encoding="utf-8-sig", lineterminator="\r")
    expect(at(".bar.txt"), of_text(at(".bar.txt"), "|", ",", "utf-8-sig"))
    frame.to_csv(at(".spaces.txt"), sep=" ", index=False, header=[name.replace(" ", "_") for name in names])
    expect(at(".spaces.txt"), of_text(at(".spaces.txt"), " ", "."))
    frame.to_parquet(at(".parquet"))
    expect(at(".parquet"), of_frame(pandas.read_parquet(at(".parquet"))))
    frame.to_excel(at(".xlsx"), index=False)
    expect(at(".xlsx"), of_frame(pandas.read_excel(at(".xlsx"), engine="openpyxl")))
    nested_forms(folder, name, records)


def nested_forms(folder, name, records):
    """Records in JSON and YAML."""
    at = lambda ending: folder / f"{name}{ending}"
    at(".records.json").write_text(json.dumps(records, indent=1))
    expect(at(".records.json"), of_records(json.loads(at(".records.json").read_text())))
    at(".lines.jsonl").write_text("".join(json.dumps(record) + "\n" for record in records))
    read = [json.loads(line) for line in at(".lines.jsonl").read_text().splitlines()]
    expect(at(".lines.jsonl"), of_records(read))
    at(".wrapped.json").write_text(json.dumps({"robot": "arm", "stations": records}))
    expect(at(".wrapped.json"), of_records(json.loads(at(".wrapped.json").read_text())["stations"]))
    at(".yaml").write_text(yaml.safe_dump(records, sort_keys=False))
    expect(at(".yaml"), of_records(yaml.safe_load(at(".yaml").read_text())))
    at(".documents.yaml").write_text(yaml.safe_dump_all(records, sort_keys=False))
    expect(at(".documents.yaml"), of_records(yaml.safe_load_all(at(".documents.yaml").read_text())))
    if all(not isinstance(value, (dict, list)) for record in records for value in record.values()):
        columns = {key: [record[key] for record in records] for key in records[0]}
        at(".columns.json").write_text(json.dumps(columns))
        expect(at(".columns.json"), of_records(records))


def main(stations, folder):
    for path in sorted(stations.glob("*.csv")):
        first = path.read_text().splitlines()[0]
        separator, decimal = (";", ",") if ";" in first else (",", ".")
        table = of_text(path, separator, decimal)
        copy = folder / path.name
        copy.write_bytes(path.read_bytes())
        expect(copy, table)
        flat_forms(folder, path.stem, table)
    for path in sorted(stations.glob("*.yaml")):
        keyed = yaml.safe_load(path.read_text())
        copy = folder / path.name
        copy.write_bytes(path.read_bytes())
        expect(copy, of_keyed(keyed))
        at = folder / f"{path.stem}.keyed.json"
        at.write_text(json.dumps(keyed))
        expect(at, of_keyed(json.loads(at.read_text())))
        records = [{"key": float(key), **record} for key, record in keyed.items()]
        nested_forms(folder, path.stem + ".list", records)
        at = folder / f"{path.stem}.parquet"
        pandas.DataFrame(records).to_parquet(at)
        expect(at, of_frame(pandas.read_parquet(at)))


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main(Path(sys.argv[1]), Path(sys.argv[2]))
