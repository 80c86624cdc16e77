"""200 hostile files, each in a batch beside two sound sessions, under a limit of memory: the sound ones are published every time, byte for byte.

    python tests/readers/hostile.py POSEGRID [--folder target/hostile] [--every N] [--only WORD] [--gigabytes 4]

Spreadsheets, Parquet, texts and logs that state counts which they have no bytes for, unpack to gigabytes, nest without end, or are cut or
altered at random; made anew each time, by rules and seeds. A batch has 120 seconds. The limit is one of the address space (`ulimit -v`).
The hostile session may have a result or none; the exit code is 0, 1 or 3. Needs pyarrow.
"""

import argparse
import hashlib
import io
import pathlib
import random
import shutil
import struct
import subprocess
import sys
import zipfile

import pyarrow
import pyarrow.parquet

ROOT = pathlib.Path(__file__).resolve().parents[2]
ARM = ROOT / "pipelines/robots/kr210-r2700-extra.toml"
JOINTS = [f"joint_a{joint}" for joint in range(1, 7)]
PLACE = ["T1_x", "T1_y", "T1_z"]
COLUMNS = ["station", *JOINTS, *PLACE]
MIB = 1 << 20

SHARED = """
[fit.full]
enabled = false
[grid]
steps_mm = [500]
[tolerance]
mm = 0.5
share = 0.95
confidence = 0.95
[output]
lake = "lake"
"""
UNCERTAINTY = "uncertainty = { range_um = 10, range_um_per_m = 0.3, transverse_um = 15, transverse_um_per_m = 6, divisor = 2 }"
TABLES = f"""
[robot]
file = "{ARM}"
name = "tiny"
[input]
folder = "sessions"
stations = "*"
[stations]
joints = {JOINTS}
joint_unit = "deg"
[stations.measured]
position = {PLACE}
unit = "mm"
[tracker]
{UNCERTAINTY}
{SHARED}"""
LOGS = f"""
[robot]
file = "{ARM}"
name = "tiny"
[input]
folder = "sessions"
[controller]
topic = "/joint_states"
time = "header"
unit = "rad"
[tracker]
topic = "/tracker/point"
time = "header"
unit = "m"
{UNCERTAINTY}
{SHARED}"""


# Spreadsheets.

TYPES = """<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types"><Default Extension="xml" ContentType="application/xml"/>
<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>
<Override PartName="/xl/workbook.xml" ContentType="application/vnd.openxmlformats-officedocument.spreadsheetml.sheet.main+xml"/>
<Override PartName="/xl/worksheets/sheet1.xml" ContentType="application/vnd.openxmlformats-officedocument.spreadsheetml.worksheet+xml"/>
<Override PartName="/xl/sharedStrings.xml" ContentType="application/vnd.openxmlformats-officedocument.spreadsheetml.sharedStrings+xml"/>
<Override PartName="/xl/styles.xml" ContentType="application/vnd.openxmlformats-officedocument.spreadsheetml.styles+xml"/></Types>"""
RELATED = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
PACKAGE = f"""<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">
<Relationship Id="rId1" Type="{RELATED}/officeDocument" Target="xl/workbook.xml"/></Relationships>"""
RELATIONS = f"""<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">
<Relationship Id="rId1" Type="{RELATED}/worksheet" Target="worksheets/sheet1.xml"/>
<Relationship Id="rId2" Type="{RELATED}/sharedStrings" Target="sharedStrings.xml"/>
<Relationship Id="rId3" Type="{RELATED}/styles" Target="styles.xml"/></Relationships>"""
MAIN = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'
BOOK = f'<workbook {MAIN} xmlns:r="{RELATED}"><sheets><sheet name="a" sheetId="1" r:id="rId1"/></sheets></workbook>'
STYLES = f'<styleSheet {MAIN}><cellXfs count="1"><xf numFmtId="0"/></cellXfs></styleSheet>'


def table_rows(count=24):
    draw = random.Random(7)
    return [[number, *(draw.uniform(-60, 60) for _ in range(9))] for number in range(1, count + 1)]


def sheet(rows=None, before="", after="", tag="<sheetData>"):
    head = "".join(f'<c t="s"><v>{place}</v></c>' for place in range(len(COLUMNS)))
    rows = "".join("<row>" + "".join(f"<c><v>{value}</v></c>" for value in row) + "</row>" for row in rows or table_rows())
    return f"<worksheet {MAIN}>{before}{tag}<row>{head}</row>{rows}</sheetData>{after}</worksheet>"


def texts(count="", unique=None, more=""):
    unique = count if unique is None else unique
    stated = f' count="{count}" uniqueCount="{unique}"' if count != "" else ""
    return f"<sst {MAIN}{stated}>" + "".join(f"<si><t>{name}</t></si>" for name in COLUMNS) + more + "</sst>"


class Bomb:
    """Text around a piece that is written again and again."""

    def __init__(self, before, piece, times, after):
        self.before, self.piece, self.times, self.after = before, piece.encode(), times, after


def book(**parts):
    files = {"[Content_Types].xml": TYPES, "_rels/.rels": PACKAGE, "xl/workbook.xml": BOOK, "xl/_rels/workbook.xml.rels": RELATIONS,
             "xl/worksheets/sheet1.xml": sheet(), "xl/sharedStrings.xml": texts(len(COLUMNS)), "xl/styles.xml": STYLES}
    short = {"sheet": "xl/worksheets/sheet1.xml", "texts": "xl/sharedStrings.xml", "styles": "xl/styles.xml", "book": "xl/workbook.xml",
             "relations": "xl/_rels/workbook.xml.rels", "types": "[Content_Types].xml", "package": "_rels/.rels"}
    files.update({short[name]: text for name, text in parts.items()})
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, text in files.items():
            if isinstance(text, Bomb):
                with archive.open(name, "w", force_zip64=True) as out:
                    out.write(text.before.encode())
                    for _ in range(text.times):
                        out.write(text.piece)
                    out.write(text.after.encode())
            else:
                archive.writestr(zipfile.ZipInfo(name), text, zipfile.ZIP_DEFLATED)
    return packed.getvalue()


def entity(text):
    """Entities that stand for ten of the one before: 10^9 of the first."""
    names = "".join(f'<!ENTITY e{n} "{f"&e{n - 1};" * 10}">' for n in range(1, 10))
    return f'<?xml version="1.0"?><!DOCTYPE a [<!ENTITY e0 "0123456789">{names}]>' + text


def workbooks():
    end, row = "</sheetData></worksheet>", "<row>" + "<c><v>1</v></c>" * 10 + "</row>"
    start = f"<worksheet {MAIN}><sheetData>"
    for count in (2**32 - 1, 2**31, 2**63 - 1, 10**30, -1, "many", 2**24):
        yield f"texts-{count}", lambda: book(texts=texts(count))
    for unique in (2**32 - 1, 0):
        yield f"unique-{unique}", lambda: book(texts=texts(10, unique))
    for ref in ("A1:XFD1048576", "A1:ZZZZZZZ99999999999", "XFD1048576:A1", "A1"):
        yield f"dimension-{ref.replace(':', '-')}", lambda: book(sheet=sheet(before=f'<dimension ref="{ref}"/>'))
    for ref in ("XFD1048576", "ZZZZZZZZZZ1", "A4294967295", "A99999999999999999999", "1A", ""):
        yield f"cell-{ref}", lambda: book(sheet=sheet().replace("</sheetData>", f'<row><c r="{ref}"><v>1</v></c></row></sheetData>'))
    for number in (1048576, 2**32 - 1, 2**64, -5):
        yield f"row-{number}", lambda: book(sheet=sheet().replace("</sheetData>", f'<row r="{number}"><c><v>1</v></c></row></sheetData>'))
    yield "bomb-rows", lambda: book(sheet=Bomb(start, row * 1000, 4000, end))
    yield "bomb-spaces", lambda: book(sheet=Bomb(start, " " * MIB, 2500, end))
    yield "bomb-text", lambda: book(texts=Bomb(f"<sst {MAIN}><si><t>", "x" * MIB, 2500, "</t></si></sst>"))
    yield "bomb-texts", lambda: book(texts=Bomb(f"<sst {MAIN}>", "<si><t>a</t></si>" * 10_000, 4000, "</sst>"))
    yield "bomb-styles", lambda: book(styles=Bomb(f"<styleSheet {MAIN}><cellXfs>", '<xf numFmtId="14"/>' * 10_000, 5000, "</cellXfs></styleSheet>"))
    yield "bomb-comment", lambda: book(book=Bomb("<workbook><!--", "-x" * MIB, 1200, "--></workbook>"))
    yield "bomb-cell", lambda: book(sheet=Bomb(f'{start}<row><c t="inlineStr"><is><t>', "y" * MIB, 1500, f"</t></is></c></row>{end}"))
    yield "bomb-empty-rows", lambda: book(sheet=Bomb(start, "<row/>" * 10_000, 10_000, end))
    for part, make in (("sheet", sheet), ("texts", texts), ("styles", lambda: STYLES), ("book", lambda: BOOK), ("relations", lambda: RELATIONS)):
        text = make()
        place = text.index(">") + 1
        yield f"deep-{part}", lambda: book(**{part: text[:place] + "<a>" * 300_000 + "</a>" * 300_000 + text[place:]})
        attributes = "".join(f' a{n}="{n}"' for n in range(100_000))
        yield f"attributes-{part}", lambda: book(**{part: text[:place - 1] + attributes + text[place - 1:]})
        yield f"entities-{part}", lambda: book(**{part: entity(text[:place] + "<b>&e9;</b>" + text[place:])})
        yield f"cut-{part}", lambda: book(**{part: text[:len(text) // 2]})
    yield "index", lambda: book(sheet=sheet().replace("<v>3</v>", "<v>4294967295</v>", 1))
    yield "index-negative", lambda: book(sheet=sheet().replace("<v>3</v>", "<v>-1</v>", 1))
    yield "sheets", lambda: book(book=BOOK.replace("<sheets>", "<sheets>" + '<sheet name="b" sheetId="2" r:id="rId9"/>' * 100_000))
    yield "outside", lambda: book(relations=RELATIONS.replace("worksheets/sheet1.xml", "../../../../../etc/passwd"))
    yield "itself", lambda: book(relations=RELATIONS.replace("worksheets/sheet1.xml", "workbook.xml"))
    yield "format", lambda: book(styles=STYLES.replace("<cellXfs", f'<numFmts><numFmt numFmtId="200" formatCode="{"[h]:mm;" * 300_000}"/></numFmts><cellXfs'))
    yield "merged", lambda: book(sheet=sheet(after="<mergeCells>" + '<mergeCell ref="A1:XFD1048576"/>' * 50_000 + "</mergeCells>"))
    whole = book()
    for size in (0, 4, 100, len(whole) - 30, len(whole) - 1):
        yield f"cut-{size}", lambda: whole[:size]
    entries = io.BytesIO()
    with zipfile.ZipFile(entries, "w") as archive:
        for number in range(70_000):
            archive.writestr(zipfile.ZipInfo(f"xl/{number}"), b"")
    yield "entries", lambda: entries.getvalue()
    # The sizes that the directory at the end states of the first file.
    for number, size in enumerate((2**32 - 2, 0, 2**31)):
        place = whole.index(b"PK\1\2")
        yield f"stated-{number}", lambda: whole[:place + 24] + struct.pack("<I", size) + whole[place + 28:]
    yield from altered("altered", whole, 12)


# Parquet.

def parquet(table, **settings):
    out = io.BytesIO()
    pyarrow.parquet.write_table(table, out, **settings)
    return out.getvalue()


def sound_columns(**more):
    rows = table_rows()
    columns = {name: pyarrow.array([float(row[place]) for row in rows]) for place, name in enumerate(COLUMNS)}
    return pyarrow.table({**columns, **more})


def nested(levels):
    kind = pyarrow.float64()
    for _ in range(levels):
        kind = pyarrow.list_(kind)
    return pyarrow.table({"x": pyarrow.array([None], type=kind)})


def again(text, times):
    """A column of one text again and again, which a dictionary holds once."""
    return pyarrow.DictionaryArray.from_arrays(pyarrow.array([0] * times, pyarrow.int32()), pyarrow.array([text]))


def parquets():
    for megabytes, times in ((20, 400), (200, 40), (1, 20_000)):
        yield f"dictionary-{megabytes}", lambda: parquet(pyarrow.table({"x": again("x" * (megabytes * MIB), times)}), compression="zstd")
    yield "text", lambda: parquet(pyarrow.table({"x": ["y" * (900 * MIB)]}), compression="zstd", use_dictionary=False)
    yield "binary", lambda: parquet(pyarrow.table({"x": [b"\0" * (300 * MIB)] * 5}), compression="snappy", use_dictionary=False)
    for levels in (60, 100, 400, 1500):
        yield f"deep-{levels}", lambda: parquet(nested(levels))
    names = [f"c{number}" for number in range(20_000)]
    yield "columns", lambda: parquet(pyarrow.table({name: [1.0] for name in names}))
    yield "groups", lambda: parquet(pyarrow.table({"x": [1.0] * 20_000}), row_group_size=1)
    yield "rows", lambda: parquet(pyarrow.table({"x": pyarrow.nulls(200_000_000, pyarrow.float64())}), row_group_size=1 << 26)
    yield "equal", lambda: parquet(pyarrow.table({"x": again("a", 100_000_000)}), row_group_size=1 << 26)
    yield "list", lambda: parquet(pyarrow.table({"x": [[1.0] * 40_000_000]}), compression="zstd")
    yield "name", lambda: parquet(pyarrow.table({"n" * (20 * MIB): [1.0]}))
    yield "metadata", lambda: parquet(sound_columns().replace_schema_metadata({"k": "v" * (200 * MIB)}), compression="zstd")
    whole = parquet(sound_columns())
    for size in (0, 4, 8, 12, len(whole) // 2, len(whole) - 8, len(whole) - 1):
        yield f"cut-{size}", lambda: whole[:size]
    for length in (0, 1, 2**31, 2**32 - 1, len(whole)):
        yield f"footer-{length}", lambda: whole[:-8] + struct.pack("<I", length) + whole[-4:]
    footer = len(whole) - 8 - struct.unpack("<I", whole[-8:-4])[0]
    yield from altered("altered", whole, 12)
    yield from altered("altered-footer", whole, 16, footer)


# Texts.

def as_text(separator=","):
    rows = [COLUMNS, *table_rows()]
    return "\n".join(separator.join(map(str, row)) for row in rows) + "\n"


def sheets_of_text():
    head = ",".join(COLUMNS)
    yield "line.csv", lambda: b"1," * (120 * MIB)
    yield "columns.csv", lambda: b",".join(b"c%d" % n for n in range(3_000_000)) + b"\n" + b"1," * 3_000_000
    yield "rejects.csv", lambda: (head + "\n").encode() + b"1,2\n" * 16_000_000
    yield "words.csv", lambda: (head + "\n").encode() + b"a,b,c,d,e,f,g,h,i,j\n" * 4_000_000
    yield "numbers.csv", lambda: (head + "\n").encode() + b"1,2,3,4,5,6,7,8,9,0\n" * 4_000_000
    yield "quote.csv", lambda: (as_text() + '"' + "x" * (60 * MIB)).encode()
    yield "quotes.csv", lambda: (head + "\n").encode() + b'"' * (60 * MIB)
    yield "zeros.csv", lambda: b"\0" * (100 * MIB)
    yield "blank.csv", lambda: (head + "\n").encode() + b"\n" * (100 * MIB)
    yield "digits.csv", lambda: (as_text() + "1," * 9 + "9" * (50 * MIB) + "\n").encode()
    yield "large.csv", lambda: (as_text() + ",".join(["1e9999", "-1e308", "1e308", "nan", "inf", "0", "0", "1e300", "1e300", "-1e300"])).encode()
    yield "wide.csv", lambda: as_text().encode("utf-16")
    yield "half.csv", lambda: as_text().encode("utf-16")[:-1]
    yield "odd.csv", lambda: as_text().encode() + bytes(range(128, 256)) * 1000
    yield "comments.csv", lambda: b"# comment\n" * 6_000_000 + as_text().encode()
    yield "deep.json", lambda: b"[" * 3_000_000
    yield "deep-objects.json", lambda: b'{"a":' * 2_000_000
    yield "records.json", lambda: b"[" + b'{"x":1},' * 8_000_000 + b'{"x":1}]'
    yield "values.json", lambda: b"[" + b"1," * 40_000_000 + b"1]"
    yield "names.json", lambda: b"[{" + b",".join(b'"n%d":1' % n for n in range(2_000_000)) + b"}]"
    yield "text.json", lambda: b'[{"x":"' + b"\\u0041" * (20 * MIB) + b'"}]'
    yield "cut.json", lambda: b'[{"station":1,"joint_a1":'
    yield "aliases.yaml", lambda: ("a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
        f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]\n" for n in range(1, 10))).encode()
    yield "deep.yaml", lambda: b"[" * 500_000
    yield "indented.yaml", lambda: b"".join(b" " * n + b"a:\n" for n in range(4000))
    yield "list.yaml", lambda: b"- {x: 1}\n" * 3_000_000
    yield "itself.yaml", lambda: b"a: &a [*a]\n"


# Logs.

MAGIC = b"\x89MCAP0\r\n"
JOINT_STATE = """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


def text(value):
    value = value if isinstance(value, bytes) else value.encode()
    return struct.pack("<I", len(value)) + value


def record(code, content, length=None):
    return struct.pack("<BQ", code, len(content) if length is None else length) + content


def schema(definition=JOINT_STATE, encoding="ros2msg", name="sensor_msgs/msg/JointState"):
    return record(3, struct.pack("<H", 1) + text(name) + text(encoding) + text(definition))


def channel(number=1, encoding="cdr", topic="/joint_states"):
    return record(4, struct.pack("<HH", number, 1) + text(topic) + text(encoding) + text(b""))


def message(content, number=0):
    time = 10**18 + number * 10**7
    return record(5, struct.pack("<HIQQ", 1, number, time, time) + content)


def joint_state(names=6, stated=None):
    body = struct.pack("<iI", 10**9, 0) + text(b"\0") + b"\0\0\0" + struct.pack("<I", names if stated is None else stated)
    return b"\0\1\0\0" + body + b"".join(text(f"joint_a{n}\0") for n in range(1, names + 1)) + bytes(200)


def chunk(packed, compression="zstd", size=None, stated=None):
    size = len(packed) if size is None else size
    content = struct.pack("<QQQI", 0, 2**63, size, 0) + text(compression)
    return record(6, content + struct.pack("<Q", len(packed) if stated is None else stated) + packed)


def log(*records, end=True):
    footer = record(15, struct.pack("<I", 0)) + record(2, struct.pack("<QQI", 0, 0, 0)) + MAGIC
    return MAGIC + record(1, text("ros2") + text("x")) + b"".join(records) + (footer if end else b"")


def zstd_of_zeros(size, window=7):
    """A frame of blocks that repeat one byte: 4 bytes for 128 kB."""
    blocks = size // (1 << 17)
    block = struct.pack("<I", (1 << 17) << 3 | 1 << 1)[:3] + b"\0"
    last = struct.pack("<I", (1 << 17) << 3 | 1 << 1 | 1)[:3] + b"\0"
    return b"\x28\xb5\x2f\xfd\0" + bytes([window << 3]) + block * (blocks - 1) + last


def logs(sound):
    start = schema(), channel()
    for size in (2**63, 2**64 - 1, 2**40, 8 << 30):
        yield f"chunk-{size}", lambda: log(*start, chunk(zstd_of_zeros(1 << 20), size=size))
    for gigabytes in (1, 4, 16):
        yield f"bomb-{gigabytes}", lambda: log(*start, chunk(zstd_of_zeros(gigabytes << 30), size=gigabytes << 30))
    yield "bomb-unstated", lambda: log(*start, chunk(zstd_of_zeros(8 << 30), size=1000))
    yield "bombs", lambda: log(*start, *[chunk(zstd_of_zeros(900 << 20), size=900 << 20)] * 6)
    yield "window", lambda: log(*start, chunk(zstd_of_zeros(1 << 20, window=21), size=1 << 20))
    for stated in (2**63, 2**64 - 1, 10**6):
        yield f"packed-{stated}", lambda: log(*start, chunk(b"abc", stated=stated))
    for length in (2**63, 2**64 - 1, 2**40, 2**32):
        yield f"record-{length}", lambda: log(*start, record(5, bytes(22), length))
    for code in (1, 3, 4, 6, 9, 12, 200):
        yield f"length-{code}", lambda: log(record(code, bytes(30), 2**62))
    yield "in-itself", lambda: log(chunk(chunk(chunk(b"", ""), ""), ""))
    for stated in (2**32 - 1, 2**31, 10**8):
        yield f"names-{stated}", lambda: log(*start, *[message(joint_state(stated=stated), n) for n in range(50)])
    many = joint_state(names=400_000)
    yield "names", lambda: log(*start, *[message(many, n) for n in range(20)])
    yield "empty", lambda: log(*start, *[message(b"", n) for n in range(300_000)])
    yield "channels", lambda: log(schema(), *[channel(n, topic=f"/{n}") for n in range(65536)] * 4)
    yield "schemas", lambda: log(*[schema(JOINT_STATE * 3000)] * 300, channel())
    yield "fields", lambda: log(schema("float64 x\n" * 3_000_000), channel(), message(bytes(100)))
    yield "array", lambda: log(schema("float64[4294967295] position\nstring[9999999] name\n"), channel(), message(bytes(100)))
    deep = "".join(f"{'=' * 80}\nMSG: a/T{n}\nT{n + 1}[1000] a\n" for n in range(30)) + f"{'=' * 80}\nMSG: a/T30\nuint8 x\n"
    yield "types", lambda: log(schema("T0[1000] a\n" + deep, name="a/Root"), channel(), message(bytes(10_000)))
    yield "type-of-itself", lambda: log(schema("Root[] a\n", name="a/Root"), channel(), message(b"\0\1\0\0" + struct.pack("<I", 2**31) * 1000))
    yield "json", lambda: log(schema("{}", "jsonschema"), channel(encoding="json"), *[message(b"[" * 1_000_000, n) for n in range(5)])
    yield "json-schema", lambda: log(schema(b'{"properties":' * 300_000, "jsonschema"), channel(encoding="json"), message(b"{}"))
    yield "protobuf", lambda: log(schema(b"\x0a" * 3_000_000, "protobuf"), channel(encoding="protobuf"), message(b"\x0b" * 1_000_000))
    yield "idl", lambda: log(schema("module a {" * 200_000, "ros2idl"), channel(), message(bytes(100)))
    yield "ros1", lambda: log(schema("float64[] position\n", "ros1msg"), channel(encoding="ros1"), message(struct.pack("<I", 2**32 - 1) + bytes(90)))
    yield "attachment", lambda: log(record(9, bytes(16) + text("a") + text("b") + struct.pack("<Q", 2**63)))
    yield "metadata", lambda: log(*[record(12, text("a") + text(text("k" * 1000) + text("v" * 100_000)))] * 2000)
    for size in (0, 8, 50, len(sound) // 3, len(sound) - 1):
        yield f"cut-{size}", lambda: sound[:size]
    yield from altered("altered", sound, 14)


def altered(name, whole, number, start=0):
    """Files with 1 to 8 bytes of them changed, from `start` on."""
    for seed in range(number):
        draw, changed = random.Random(seed), bytearray(whole)
        for _ in range(1 + seed % 8):
            changed[draw.randrange(start, len(whole))] = draw.choice([0, 1, 0x7F, 0x80, 0xFF, draw.randrange(256)])
        yield f"{name}-{seed}", lambda: bytes(changed)


class Batch:
    """A folder of three sessions, two of which are sound, and what these published when they were alone."""

    def __init__(self, program, folder, pipeline, sound, name, gigabytes):
        self.program, self.folder, self.name, self.limit = program, folder, name, gigabytes << 20
        self.beside_it = {file: content for file, content in next(iter(sound.values())).items() if not file.startswith(name)}
        shutil.rmtree(folder, ignore_errors=True)
        for session, files in sound.items():
            for file, content in files.items():
                path = folder / "sessions" / session / file
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(content)
        (folder / "p.toml").write_text(pipeline)
        code, said = self.run()
        self.alone = self.published()
        if code not in (0, 3) or len({path.parts[2] for path in self.alone}) != len(sound):
            sys.exit(f"the sound sessions have no result: {said}")

    def run(self):
        shutil.rmtree(self.folder / "lake", ignore_errors=True)
        command = ["bash", "-c", f'ulimit -v {self.limit}; exec "$@"', "bash", str(self.program), "run", str(self.folder / "p.toml")]
        try:
            done = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=120)
        except subprocess.TimeoutExpired:
            return "120 s", ""
        return done.returncode, done.stdout + done.stderr

    def published(self):
        lake = self.folder / "lake"
        files = (path for path in lake.glob("*/*/*/*.parquet") if path.parts[-2] in ("one", "two") and path.parts[-4] != "asked")
        return {path.relative_to(lake): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}

    def beside(self, content, suffix):
        """What is wrong where this file is the third session's; None where nothing is."""
        hostile = self.folder / "sessions" / "hostile"
        hostile.mkdir(exist_ok=True)
        (hostile / (self.name + suffix)).write_bytes(content)
        # A log alone waits for the one of the instrument, unread.
        for file, sound in self.beside_it.items():
            (hostile / file).write_bytes(sound)
        code, said = self.run()
        shutil.rmtree(hostile)
        if code not in (0, 1, 3):
            return f"exit code {code}: {said[-400:]}"
        if "panicked" in said:
            return f"a panic: {said[-400:]}"
        return None if self.published() == self.alone else f"the sound sessions are not published as when alone: {said[-400:]}"


def sound_logs(program, folder):
    command = [program, "simulate", ARM, "--home=0,-75,100,25,55,-15", "--seed", "5", "--random-joints", "24"]
    for session in ("one", "two"):
        subprocess.run([*map(str, command), "--session", session, "--table", "--out", str(folder / session)], check=True, capture_output=True)
    names = "controller.mcap", "tracker.mcap", "stations.csv"
    return {session: {name: (folder / session / name).read_bytes() for name in names} for session in ("one", "two")}


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("program", type=pathlib.Path)
    arguments.add_argument("--folder", type=pathlib.Path, default=ROOT / "target/hostile")
    arguments.add_argument("--every", type=int, default=1)
    arguments.add_argument("--only", default="")
    arguments.add_argument("--gigabytes", type=int, default=4)
    given = arguments.parse_args()
    program = given.program.resolve() if given.program.exists() else given.program
    shutil.rmtree(given.folder, ignore_errors=True)
    made = sound_logs(program, given.folder / "made")
    of_logs = {session: {name: own[name] for name in ("controller.mcap", "tracker.mcap")} for session, own in made.items()}
    of_tables = {session: {"stations.csv": own["stations.csv"]} for session, own in made.items()}
    tables = Batch(program, given.folder / "tables", TABLES, of_tables, "stations", given.gigabytes)
    logged = Batch(program, given.folder / "logs", LOGS, of_logs, "controller", given.gigabytes)
    kinds = (
        ("xlsx", workbooks(), tables),
        ("parquet", parquets(), tables),
        ("text", sheets_of_text(), tables),
        ("mcap", logs(of_logs["one"]["controller.mcap"]), logged),
    )
    problems, number = [], 0
    for kind, files, batch in kinds:
        for place, (name, content) in enumerate(files):
            whole = f"{kind}-{name}"
            if place % given.every or given.only not in whole:
                continue
            number += 1
            suffix = pathlib.Path(name).suffix if kind == "text" else f".{kind}"
            problem = batch.beside(content(), suffix)
            if problem:
                problems.append(f"{whole}: {problem}")
                print(f"PROBLEM {problems[-1]}", file=sys.stderr, flush=True)
    print(f"{number} hostile files, {len(problems)} problems")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
