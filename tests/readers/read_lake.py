"""Reads a lake with pyarrow, polars and DuckDB, none of them posegrid's own code, and holds it against schemas/*.toml.

    python tests/readers/read_lake.py LAKE [--schemas schemas] [--all-tables] [--sql DOCUMENT…]

Checked for every file: columns and their order, types, nulls, the words of enumerations, metadata, and that the three
readers see the same values, and that the digest in the file's metadata is that of its content, worked out here as
`io::table::digest` says; for every table: that the readers take the folder as one table, with the same number of
rows; for the lake: that robot, session and run in the rows are those in the path, and that every row joins `runs`. Then
the SQL of each DOCUMENT runs on a copy of the lake: it has to give rows, and what goes by the view current_runs the same rows
beside files that do not belong.
"""

import argparse
import datetime
import json
import pathlib
import re
import shutil
import struct
import sys
import tempfile
import urllib.parse

import blake3
import duckdb
import polars
import pyarrow
import pyarrow.dataset
import pyarrow.parquet

import schemas

ARROW_TYPES = {
    "timestamp": "timestamp[us, tz=UTC]",
    "float64": "double",
    "int64": "int64",
    "bool": "bool",
    "string": "string",
    "list<float64>": "list<element: double not null>",
    "list<int64>": "list<element: int64 not null>",
    "list<string>": "list<element: string not null>",
}
POLARS_TYPES = {
    "timestamp": polars.Datetime("us", "UTC"),
    "float64": polars.Float64,
    "int64": polars.Int64,
    "bool": polars.Boolean,
    "string": polars.String,
    "list<float64>": polars.List(polars.Float64),
    "list<int64>": polars.List(polars.Int64),
    "list<string>": polars.List(polars.String),
}
DUCKDB_TYPES = {
    "timestamp": "TIMESTAMP WITH TIME ZONE",
    "float64": "DOUBLE",
    "int64": "BIGINT",
    "bool": "BOOLEAN",
    "string": "VARCHAR",
    "list<float64>": "DOUBLE[]",
    "list<int64>": "BIGINT[]",
    "list<string>": "VARCHAR[]",
}

problems = []


def expect(where, what, found, expected):
    if found != expected:
        problems.append(f"{where}: {what}: found {found!r}, expected {expected!r}")


def name_in_path(folder):
    return "" if folder == "%" else urllib.parse.unquote(folder)


def check_file(file, schema):
    columns = schema["column"]
    names = [column["name"] for column in columns]
    types = [column["type"] for column in columns]
    arrow = pyarrow.parquet.ParquetFile(file).read()
    expect(file, "pyarrow columns", arrow.column_names, names)
    expect(file, "pyarrow types", [str(t) for t in arrow.schema.types], [ARROW_TYPES[t] for t in types])
    expect(file, "nullable", [f.nullable for f in arrow.schema], [c.get("nullable", False) for c in columns])
    check_metadata(file, schema, pyarrow.parquet.read_metadata(file).metadata)
    check_digest(file, schema, arrow, pyarrow.parquet.read_metadata(file).metadata)

    with_polars = polars.read_parquet(file)
    expect(file, "polars schema", dict(with_polars.schema), {n: POLARS_TYPES[t] for n, t in zip(names, types)})

    with_duckdb = duckdb.read_parquet(str(file))
    expect(file, "DuckDB columns", with_duckdb.columns, names)
    expect(file, "DuckDB types", [str(t) for t in with_duckdb.types], [DUCKDB_TYPES[t] for t in types])

    if problems:
        return
    rows = with_duckdb.fetchall()
    expect(file, "rows", (with_polars.height, len(rows)), (arrow.num_rows, arrow.num_rows))
    for place, column in enumerate(columns):
        values = arrow.column(place).to_pylist()
        where = f"{file}, column {column['name']}"
        if values != with_polars.get_column(column["name"]).to_list():
            problems.append(f"{where}: polars sees other values than pyarrow")
        if values != [row[place] for row in rows]:
            problems.append(f"{where}: DuckDB sees other values than pyarrow")
        if "values" in column:
            expect(where, "words outside the schema", set(values) - {None, *column["values"]}, set())


def check_metadata(file, schema, metadata):
    stated = {key.decode(): value.decode() for key, value in metadata.items()}
    expect(file, "table in the metadata", stated.get("posegrid.table"), schema["table"])
    expect(file, "version in the metadata", stated.get("posegrid.schema_version"), str(schema["version"]))
    for key, prop in (("posegrid.units", "unit"), ("posegrid.frames", "frame")):
        expected = {column["name"]: column[prop] for column in schema["column"] if prop in column}
        expect(file, f"{prop}s in the metadata", json.loads(stated.get(key, "{}")), expected)
    # A record of corrections is named by its own digest, a request by its number.
    if schema["table"] not in ("asked", "corrections"):
        expect(file, "run in the metadata", stated.get("posegrid.run"), file.stem)


def text(value):
    return struct.pack("<Q", len(value)) + value


def counted(values):
    """The digest of a sequence in which equal neighbours are counted."""
    hasher, run, count = blake3.blake3(), None, 0
    for value in values:
        if count and value != run:
            hasher.update(text(run) + struct.pack("<Q", count))
            count = 0
        run, count = value, count + 1
    if count:
        hasher.update(text(run) + struct.pack("<Q", count))
    return hasher.digest()


def digest(schema, table, metadata):
    """The digest of a table's content and of our entries in its file's metadata."""
    own = {k: v for k, v in metadata.items() if k.startswith(b"posegrid.") and k != b"posegrid.content_digest"}
    whole = [text(b"posegrid table 1"), struct.pack("<Q", len(own))]
    whole += [text(key) + text(own[key]) for key in sorted(own)]
    whole += [struct.pack("<Q", len(schema["column"]))]
    for place, column in enumerate(schema["column"]):
        rows = table.column(place).to_pylist()
        there = [row for row in rows if row is not None]
        is_list = column["type"].startswith("list")
        values = [value for row in there for value in row] if is_list else there
        kind = column["type"].removeprefix("list<").removesuffix(">")
        if kind == "timestamp":
            values = [(value - datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)) // datetime.timedelta(microseconds=1) for value in values]
        if kind in ("float64", "int64", "timestamp"):
            form = "<d" if kind == "float64" else "<q"
            content = blake3.blake3(b"".join(struct.pack(form, value) for value in values)).digest()
        elif kind == "bool":
            content = counted(bytes([value]) for value in values)
        else:
            content = counted(value.encode() for value in values)
        lengths = counted(struct.pack("<Q", len(row)) for row in there) if is_list else counted([])
        whole += [text(column["name"].encode()), text(column["type"].encode()), bytes([column.get("nullable", False)])]
        whole += [counted(bytes([row is not None]) for row in rows), lengths, content]
    whole += [struct.pack("<Q", table.num_rows)]
    return blake3.blake3(b"".join(whole)).hexdigest()


def check_digest(file, schema, table, metadata):
    stated = metadata.get(b"posegrid.content_digest", b"none").decode()
    expect(file, "digest of the content", stated, digest(schema, table, metadata))


def check_path(file):
    key = tuple(name_in_path(part) for part in (file.parts[-3], file.parts[-2], file.stem))
    name = {"corrections": "correction", "asked": "number"}.get(file.parts[-4], "run")
    table = pyarrow.parquet.read_table(file, columns=["robot", "session", name])
    for row in set(zip(*(table.column(name).to_pylist() for name in table.column_names))):
        row = (*row[:2], f"{row[2]:08}") if name == "number" else row
        expect(file, "robot, session and run of a row", row, key)


def check_table(folder, files):
    whole = folder / "*" / "*" / "*.parquet"
    rows = sum(pyarrow.parquet.read_metadata(file).num_rows for file in files)
    seen = {
        "pyarrow": pyarrow.dataset.dataset(files, format="parquet").count_rows(),
        "polars": polars.scan_parquet(whole).select(polars.len()).collect().item(),
        "DuckDB": duckdb.sql(f"select count(*) from read_parquet('{whole}')").fetchall()[0][0],
    }
    for reader, count in seen.items():
        expect(folder, f"rows of the whole folder by {reader}", count, rows)
    return rows


# Tables of sessions as joined, of estimates and of grids, which exist by rows of their own; all others by their runs' rows in runs.
ROWS_OF = {
    "joined_sessions": "joined_sessions",
    "readings": "joined_sessions",
    "estimates": "estimates",
    "estimate_residuals": "estimates",
    "grids": "grids",
    "grid_errors": "grids",
}


def check_runs(lake, folders):
    def all_of(table):
        return f"read_parquet('{lake}/{table}/*/*/*.parquet')"

    runs = all_of("runs")
    for folder in folders:
        table = all_of(folder.name)
        rows = all_of(ROWS_OF.get(folder.name, "runs"))
        committed = f"(robot, run) in (select (robot, run) from {rows})"
        orphans = duckdb.sql(f"select distinct robot, run from {table} where not {committed}").fetchall()
        if orphans:
            print(f"note: {folder.name} holds rows of runs that never committed: {orphans}")
    made_of = duckdb.sql(f"select robot, unnest(made_of) from {runs}").fetchall()
    for robot, name in made_of:
        session, joined = name.rsplit("/", 1)
        query = f"select sum(dwells) from {all_of('joined_sessions')} where robot = ? and session = ? and run = ?"
        dwells = duckdb.execute(query, [robot, session, joined]).fetchall()[0][0]
        readings = f"select count(distinct station) from {all_of('readings')} where robot = ? and session = ? and run = ?"
        found = duckdb.execute(readings, [robot, session, joined]).fetchall()[0][0]
        expect(f"{lake}, {name}", "dwells of a session as joined", found, dwells)
    digests = f"select unnest(table_names) as name, unnest(table_rows) as rows, robot, run from {runs}"
    for name, rows, robot, run in duckdb.sql(digests).fetchall():
        table, session = name.split("/", 1)
        if table == "report":
            pages = [page for page in (lake / "report").glob(f"*/*/{run}.html") if name_in_path(page.parts[-2]) == session]
            expect(f"{lake}, run {run}", "pages", len(pages), 1)
            continue
        if not (lake / table).is_dir():
            problems.append(f"{lake}, run {run}: its table {name} is missing")
            continue
        where = f"read_parquet('{lake}/{table}/*/*/*.parquet')"
        query = f"select count(*) from {where} where robot = ? and session = ? and run = ?"
        found = duckdb.execute(query, [robot, session, run]).fetchall()[0][0]
        expect(f"{lake}, run {run}", f"rows of {name}", found, rows)


def check_sql(lake, documents):
    """Runs the SQL of documents on a copy of the lake, before and after files are planted that do not belong.

    Each block gives rows. One of a view follows the statements that `posegrid schema views` prints, and gives the same rows beside
    the planted files.
    """
    blocks = [(document, sql) for document in documents for sql in re.findall(r"```sql\n(.*?)```", document.read_text(), re.DOTALL)]
    # What is kept by month is read by read_compact.py.
    blocks = [(document, sql) for document, sql in blocks if "'lake/compact/" not in sql and "-- runs newer" not in sql]
    views = "".join((pathlib.Path(__file__).parents[2] / "src/files/schema" / name).read_text() for name in ("views.sql", "sessions.sql"))
    of_views = re.findall(r"^CREATE (?:VIEW|MACRO) (\w+)", views, re.MULTILINE)
    takes_views = lambda sql: "CREATE VIEW" not in sql and re.search(rf"FROM ({'|'.join(of_views)})\b", sql)
    blocks = [(document, views + sql if takes_views(sql) else sql) for document, sql in blocks]
    with tempfile.TemporaryDirectory() as folder:
        copy = pathlib.Path(folder) / "lake"
        shutil.copytree(lake, copy)
        own = sorted((copy / "accuracy").glob("*/*/*.parquet"))[0]
        row = sorted((copy / "runs").glob("*/*/*.parquet"))[0]

        def rows(sql):
            connection = duckdb.connect()
            # Requests of a lake just made are of today, whatever day a document asks for.
            sql = re.sub(r"asked_at < '[0-9-]+'", "asked_at < '9999-01-01'", sql)
            statements = [part for part in sql.replace("'lake/", f"'{copy}/").split(";") if part.strip()]
            return sorted(str(row) for row in [connection.execute(part) for part in statements][-1].fetchall())

        before = [rows(sql) for _, sql in blocks]
        for planted in (f"accuracy/r/x/zz.parquet", f"accuracy/r/x/{own.name}", f"{own.parent.relative_to(copy)}/zz.parquet"):
            (copy / planted).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(own, copy / planted)
        (copy / "runs/r/x").mkdir(parents=True)
        shutil.copy(row, copy / "runs/r/x/zz.parquet")
        for (document, sql), found in zip(blocks, before):
            # A lake just made holds no run that took the place of another.
            if not found and "FROM changes" not in sql:
                problems.append(f"{document}: its query gives no row of {lake}: {sql}")
            if "CREATE VIEW current_runs" in sql:
                expect(document, "rows of its query beside foreign files", rows(sql), found)
        print(f"the documents' queries: {', '.join(str(len(found)) for found in before)} rows, and no other beside foreign files")


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("lake", type=pathlib.Path)
    arguments.add_argument("--schemas", type=pathlib.Path, default=pathlib.Path("schemas"))
    arguments.add_argument("--sql", type=pathlib.Path, nargs="+", help="documents whose SQL to run too, on a copy of the lake")
    arguments.add_argument("--all-tables", action="store_true", help="every published table has to be there")
    given = arguments.parse_args()

    published = {schema["table"]: schema for schema in schemas.read_all(given.schemas) if schema["role"] == "published"}
    # Pages stand beside the tables, and their rows by month; they are for people. What begins with a dot is the lake's own.
    folders = sorted(
        folder
        for folder in given.lake.iterdir()
        if folder.is_dir() and folder.name not in ("report", "compact", "pages") and not folder.name.startswith(".")
    )
    expect(given.lake, "tables without a schema", [f.name for f in folders if f.name not in published], [])
    there = {folder.name for folder in folders}
    if not there:
        problems.append(f"{given.lake}: there is no table at all")
    if given.all_tables:
        expect(given.lake, "tables missing", sorted(published.keys() - there), [])
    for folder in folders if not problems else []:
        files = sorted(folder.glob("*/*/*.parquet"))
        for file in files:
            check_file(file, published[folder.name])
            check_path(file)
        if not files:
            problems.append(f"{folder}: no file")
        elif not problems:
            print(f"{folder.name}: {len(files)} files, {check_table(folder, files)} rows, three readers agree")
    if not problems:
        check_runs(given.lake, folders)
    if not problems and given.sql:
        check_sql(given.lake, given.sql)
    for problem in problems:
        print(f"PROBLEM {problem}", file=sys.stderr)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
