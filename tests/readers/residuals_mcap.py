"""Reads what `posegrid export --format mcap` made of a run's residuals with packages of others, and holds it against the lake.

    python tests/readers/residuals_mcap.py residuals.mcap LAKE

Checked: every message keeps the schema that stands in the file; a message of numbers and an arrow for every row of table
`residuals`, at the time that `stations` has; arrows that begin at the predicted point and are as many times as long as the
error as the file's metadata says, along the error; one colour before and another after.
"""

import argparse
import collections
import json
import math
import pathlib
import sys

import jsonschema
import pyarrow.parquet
from mcap.reader import make_reader

KEY = ("of_session", "split", "model", "angles", "base_refit")
# Numbers are written exactly; sums of them here are not those of the program.
WITHIN = 1e-9

problems = []


def expect(where, found, wanted):
    if found != wanted:
        problems.append(f"{where}: {found!r}, expected {wanted!r}")


def near(where, found, wanted):
    if not math.dist(found, wanted) <= WITHIN:
        problems.append(f"{where}: {found}, expected {wanted}")


def rows(lake, table, run):
    for file in sorted((lake / table).glob(f"*/*/{run}.parquet")):
        yield from pyarrow.parquet.read_table(file).to_pylist()


def ns(time):
    return time["sec"] * 10**9 + time["nsec"]


def point(value):
    return value["x"], value["y"], value["z"]


def forward(q):
    """Where a rotation turns x to."""
    x, y, z, w = (q[part] for part in "xyzw")
    return 1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)


def read(path):
    """The metadata record, and the messages by topic with their times; each is held against its schema."""
    messages = collections.defaultdict(list)
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}["posegrid"]
        keeps = {}
        for schema, channel, message in reader.iter_messages():
            expect(channel.topic, (schema.encoding, channel.message_encoding), ("jsonschema", "json"))
            if schema.id not in keeps:
                text = json.loads(schema.data)
                jsonschema.Draft202012Validator.check_schema(text)
                keeps[schema.id] = jsonschema.Draft202012Validator(text)
            body = json.loads(message.data)
            for error in keeps[schema.id].iter_errors(body):
                problems.append(f"{channel.topic}: {error.message}")
            messages[channel.topic, schema.name].append((message.log_time, body))
    return metadata, messages


def check_numbers(topic, messages, residuals, starts):
    for log_time, body in messages:
        key = (body["session"], body["split"], body["model"], body["angles"], body["base_refit"], body["station"])
        row = residuals.pop(key, None)
        if row is None:
            problems.append(f"{topic}: {key} is no row of the table, or there twice")
            continue
        where = f"{topic}, station {body['station']}"
        expect(f"{where}, time", (log_time, ns(body["timestamp"])), (starts[key[0], key[5]],) * 2)
        expect(f"{where}, norm", body["error_mm"], row["residual_mm"])
        expect(f"{where}, error", point(body["error_vector_mm"]), tuple(row[f"residual_{axis}_mm"] for axis in "xyz"))
        expect(f"{where}, attained", point(body["attained_mm"]), tuple(row[f"{axis}_mm"] for axis in "xyz"))
        expect(f"{where}, refit", body["used_for_refit"], row["used_for_refit"])
        expect(f"{where}, fold", body.get("fold"), row["fold"])


def check_arrows(topic, messages, numbers, scale):
    """One message with all arrows, at the first of their times."""
    expect(f"{topic}, messages", len(messages), 1)
    ((log_time, scene),) = messages
    entities = {entity["id"]: entity for entity in scene["entities"]}
    expect(f"{topic}, stations", sorted(entities), sorted(str(body["station"]) for _, body in numbers))
    expect(f"{topic}, time", log_time, min(time for time, _ in numbers))
    colours = set()
    for _, body in numbers:
        entity = entities.get(str(body["station"]))
        if entity is None:
            continue
        (arrow,) = entity["arrows"]
        where = f"{topic}, station {body['station']}"
        error = point(body["error_vector_mm"])
        expect(f"{where}, frame and time", (entity["frame_id"], entity["timestamp"]), ("base", body["timestamp"]))
        start = point(arrow["pose"]["position"])
        attained = point(body["attained_mm"])
        near(f"{where}, start", [1000 * x for x in start], [x - e for x, e in zip(attained, error)])
        long = 1000 * (arrow["shaft_length"] + arrow["head_length"])
        ahead = forward(arrow["pose"]["orientation"])
        near(f"{where}, arrow", [long * x for x in ahead], [scale * e for e in error])
        colours.add(tuple(arrow["color"].values()))
    return colours


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("log", type=pathlib.Path)
    arguments.add_argument("lake", type=pathlib.Path)
    given = arguments.parse_args()

    metadata, messages = read(given.log)
    run, scale = metadata["run"], float(metadata["arrow_scale"])
    residuals = {(*(row[name] for name in KEY), row["station"]): row for row in rows(given.lake, "residuals", run)}
    starts = {(row["session"], row["station"]): row["start_ns"] for row in rows(given.lake, "stations", run)}
    expect("rows by the metadata", metadata["residuals"], str(len(residuals)))
    told = len(residuals)
    if told == 0:
        problems.append(f"{given.lake} has no residuals of run {run}")
    colours = {"before": set(), "after": set()}
    for (topic, schema), own in messages.items():
        if schema == "posegrid.Residual":
            check_numbers(topic, own, residuals, starts)
        else:
            expect(topic, schema, "foxglove.SceneUpdate")
            numbers = messages[topic.removesuffix("/vectors") + "/error", "posegrid.Residual"]
            colours[topic.split("/")[1]] |= check_arrows(topic, own, numbers, scale)
    if residuals:
        problems.append(f"{len(residuals)} rows of the table are in no message, {next(iter(residuals))} for one")
    expect("colours before and after", [len(own) for own in colours.values()], [1, 1])
    expect("colours before that are those after", colours["before"] & colours["after"], set())
    for problem in problems[:20]:
        print(f"PROBLEM {problem}", file=sys.stderr)
    print(f"{given.log.name}: {told} residuals in {len(messages)} topics, {len(problems)} problems")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
