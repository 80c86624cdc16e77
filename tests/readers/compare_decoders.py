"""Decodes a log of every type in every encoding with the packages in use and compares it, bit for bit, with posegrid.

    python tests/readers/compare_decoders.py FOLDER

FOLDER holds messages.mcap and decoded.jsonl, as the test `a_sample_of_every_type…` writes them: a line for each message
and field path, with the bits of each number found there, each text, null for what is absent. Here the messages are
decoded by `mcap` with `mcap-ros1-support` (ros1msg), `mcap-ros2-support` (ros2msg), `mcap-ros2idl-support` (ros2idl),
`cyclonedds` (CDR 2, plain and delimited), `mcap-protobuf-support` and `json`, none of them posegrid's own code.
"""

import argparse
import dataclasses
import json
import math
import pathlib
import re
import struct
import sys

from cyclonedds.idl import IdlStruct, annotations, types
from google.protobuf.message import Message
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as Protobuf
from mcap_ros1.decoder import DecoderFactory as Ros1Msg
from mcap_ros2.decoder import DecoderFactory as Ros2Msg
from mcap_ros2idl_support import Ros2DecodeFactory as Ros2Idl

STEP = re.compile(r"\[(\d*)\]")
ABSENT = object()


class Json:
    """Decodes JSON messages."""

    def decoder_for(self, message_encoding, schema):
        return json.loads if message_encoding == "json" else None


PRIMITIVES = {
    "bool": bool,
    "byte": types.uint8,
    **{name: getattr(types, name) for name in ("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64")},
    **{name: getattr(types, name) for name in ("float32", "float64")},
}


def cyclone(extensibility):
    """The sample's type as Cyclone DDS has it: @final is plain in CDR 2, @appendable is delimited."""

    def struct(name, fields):
        of = dataclasses.make_dataclass(name, fields, bases=(IdlStruct,))
        return extensibility(of)

    inner = struct("Inner", [("x", types.uint8), ("y", types.float64), ("s", str)])
    fields = [("word", types.bounded_str[8])]
    for name, of in PRIMITIVES.items():
        fields += [
            (f"one_{name}", of),
            (f"three_{name}", types.array[of, 3]),
            (f"some_{name}", types.sequence[of]),
            (f"few_{name}", types.sequence[of, 5]),
            (f"inner_{name}", inner),
        ]
    fields += [
        ("words", types.sequence[str]),
        ("pair", types.array[str, 2]),
        ("list", types.sequence[inner]),
        ("both", types.array[inner, 2]),
        ("last", types.int32),
    ]
    return struct("All", fields)


class Idl(Ros2Idl):
    """Decodes what has an IDL schema; the rest is left to the others."""

    plain_2, delimited_2 = cyclone(annotations.final), cyclone(annotations.appendable)

    def decoder_for(self, message_encoding, schema):
        if schema is None or schema.encoding != "ros2idl":
            return None
        version_1 = super().decoder_for(message_encoding, schema)

        def decode(data):
            if data[1] < 6:
                return version_1(data)
            return (self.plain_2 if data[1] < 8 else self.delimited_2).deserialize(data)

        return decode


def field(value, name):
    """A field of a message, or ABSENT."""
    if isinstance(value, Message):
        of = value.DESCRIPTOR.fields_by_name[name]
        # A field with presence that is not set has no value, though Python would tell its default.
        if of.has_presence and not value.HasField(name):
            return ABSENT
        return getattr(value, name)
    if isinstance(value, dict):
        return value.get(name, ABSENT)
    return getattr(value, name, ABSENT)


def is_array(value):
    scalar = (str, dict, Message, bool, int, float)
    return not isinstance(value, scalar) and hasattr(value, "__len__")


def follow(value, steps):
    """What lies at the end of the steps: a value, ABSENT, or a list where a step means each element."""
    for place, step in enumerate(steps):
        if value is ABSENT or value is None:
            return ABSENT
        if step == "":
            rest = steps[place + 1 :]
            return [follow(element, rest) for element in value] if is_array(value) else ABSENT
        if isinstance(step, int):
            value = value[step] if is_array(value) and step < len(value) else ABSENT
        elif isinstance(value, list):
            return ABSENT
        else:
            value = field(value, step)
    return value


def steps_of(path):
    """`a.b[1].c` → a, b, 1, c; `[]` is an empty step."""
    found = []
    for part in path.split("."):
        name = part.split("[")[0]
        if name:
            found.append(name)
        found.extend(int(index) if index else "" for index in STEP.findall(part))
    return found


def element(value):
    """A value as posegrid's line has it: bits of a number, a text, or null."""
    if isinstance(value, (bool, int, float)):
        number = float(value)
        bits = "nan" if math.isnan(number) else struct.pack(">d", number).hex()
        return {"bits": bits}
    return value if isinstance(value, str) else None


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=pathlib.Path)
    folder = parser.parse_args().folder

    messages = {}
    with open(folder / "messages.mcap", "rb") as log:
        reader = make_reader(log, decoder_factories=[Idl(), Ros2Msg(), Ros1Msg(), Protobuf(), Json()])
        for _, channel, _, message in reader.iter_decoded_messages():
            messages.setdefault(channel.topic, []).append(message)

    problems, compared, topics = [], 0, {}
    for line in open(folder / "decoded.jsonl", encoding="utf-8"):
        decoded = json.loads(line)
        topic, index, path = decoded["topic"], decoded["index"], decoded["path"]
        value = follow(messages[topic][index], steps_of(path))
        expected = [element(x) for x in value] if is_array(value) else [element(value)]
        if decoded["values"] != expected:
            problems.append(f"{topic} {index} {path}: posegrid has {decoded['values']}, expected {expected}")
        compared += len(expected)
        topics[topic] = topics.get(topic, 0) + 1

    for problem in problems[:40]:
        print(problem, file=sys.stderr)
    for topic, fields in sorted(topics.items()):
        print(f"{topic}: {len(messages[topic])} messages, {fields} fields")
    print(f"{compared} values compared, {len(problems)} fields differ")
    sys.exit(1 if problems or set(topics) != set(messages) else 0)


main()
