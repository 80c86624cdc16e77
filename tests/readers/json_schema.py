"""The JSON Schemas of pipeline and robot files, by a validator that knows nothing of posegrid.

    python tests/readers/json_schema.py POSEGRID

Every file under pipelines/ is valid by the schema that its first line names, which is there and is what `posegrid schema` prints. Files that
were broken in one place are invalid by it, and are refused by posegrid with words of that place.
"""

import json
import re
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

import jsonschema

ROOT = Path(__file__).resolve().parents[2]
FIRST = re.compile(r"#:schema (\S+)\n")


def schema_of(path: Path) -> Path:
    with path.open(encoding="utf-8") as file:
        first = FIRST.fullmatch(file.readline())
    assert first, f"{path}: the first line names no schema"
    return (path.parent / first[1]).resolve()


def faults(validator, text: str) -> list[str]:
    file = json.loads(json.dumps(tomllib.loads(text), default=str))
    return [f"{'.'.join(map(str, own.absolute_path))}: {own.message}" for own in validator.iter_errors(file)]


def broken(text: str, is_robot: bool) -> list[tuple[str, str]]:
    """What is wrong, and the text of the file with that."""
    made = []
    headings = re.findall(r"(?m)^\[+([a-z._]+)\]+$", text)
    # A key spelt wrongly, and one with a value of another type, in each section.
    for section, key in re.findall(r"(?m)^\[([a-z._]+)\]\n(?:#.*\n)*([a-z_]+) = ", text):
        own = re.compile(rf"(?m)^(\[{re.escape(section)}\]\n(?:#.*\n)*){key} = ")
        made.append((f"[{section}] {key}x", own.sub(rf"\g<1>{key}x = ", text, count=1)))
        made.append((f"[{section}] {key} = a date", own.sub(rf"\g<1>{key} = 2026-01-01\n{key}x = ", text, count=1)))
    if is_robot:
        made.append(("no model", re.sub(r"(?m)^model = .*\n", "", text)))
        made.append(("another convention", re.sub(r'(?m)^convention = .*', 'convention = "dh"', text)))
        made.append(("a joint without limits", re.sub(r"(?m)^limits_deg = .*\n", "", text, count=1)))
        made.append(("a joint without name", re.sub(r"(?m)^name = .*\n", "", text, count=1)))
        return [one for one in made if one[1] != text]
    for heading in ("robot", "input", "tracker", "grid", "tolerance", "output"):
        if heading in headings:
            made.append((f"no [{heading}]", re.sub(rf"(?ms)^\[{heading}\]\n.*?(?=^\[|\Z)", "", text)))
    edits = [
        ('unit = "m"', 'unit = "metre"'), ("share = 0.95", "share = 1.5"), ("confidence = 0.95", 'confidence = "high"'),
        ("\nmm = 0.5", "\nmm = -0.5"), ("steps_mm = [", "steps_mm = [0, "), ("up = [0, 0, 1]", "up = [0, 0]"),
        ("divisor = 2", "divisor = 2, divider = 2"), ("range_um = 10", "range_um = -1"), ("target_is_tool = ", "target_is_tool = 1 # "),
        ('joint_unit = "rad"', 'joint_unit = "turn"'), ('time = "header"', 'time = "stamp"'), ("sessions = [", "sessions = [1, "),
    ]
    made += [(new.strip(), text.replace(old, new, 1)) for old, new in edits]
    return [one for one in made if one[1] != text]


def main(posegrid: str) -> None:
    shipped = [path for path in sorted((ROOT / "pipelines").rglob("*.toml")) if FIRST.match(path.read_text(encoding="utf-8"))]
    of_suites = {path for path in (ROOT / "pipelines/benchmarks").glob("*.toml")}
    left = {path for path in (ROOT / "pipelines").rglob("*.toml")} - set(shipped) - of_suites
    assert not left, f"no schema in the first line of {sorted(map(str, left))}"
    validators, refused = {}, 0
    for kind in ("pipeline", "robot"):
        path = ROOT / f"schemas/json/{kind}.json"
        printed = subprocess.run([posegrid, "schema", kind, "--format", "json-schema"], check=True, capture_output=True, text=True).stdout
        assert json.loads(printed) == json.loads(path.read_text(encoding="utf-8")), f"{path} is not what posegrid schema {kind} prints"
        jsonschema.Draft202012Validator.check_schema(json.loads(printed))
        validators[path] = jsonschema.Draft202012Validator(json.loads(printed))
    for path in shipped:
        found = faults(validators[schema_of(path)], path.read_text(encoding="utf-8"))
        assert not found, f"{path}: {found}"
    for path in [ROOT / "pipelines/quickstart.toml", ROOT / "pipelines/stations-ur10-random.toml", ROOT / "pipelines/robots/ur10.toml"]:
        is_robot = path.parent.name == "robots"
        for what, text in broken(path.read_text(encoding="utf-8"), is_robot):
            try:
                assert faults(validators[schema_of(path)], text), f"{path}, {what}: valid by the schema"
            except tomllib.TOMLDecodeError as error:
                raise AssertionError(f"{path}, {what}: {error}") from error
            with tempfile.NamedTemporaryFile("w", suffix=".toml", dir=path.parent, encoding="utf-8") as file:
                file.write(text)
                file.flush()
                checked = [posegrid, "check", file.name] if not is_robot else [posegrid, "robot", file.name]
                code = subprocess.run(checked, capture_output=True, text=True).returncode
            assert code == 2, f"{path}, {what}: posegrid gives {code}"
            refused += 1
    print(f"{len(shipped)} files are valid by their schemas; {refused} broken ones are not, and posegrid refuses them")


if __name__ == "__main__":
    main(sys.argv[1])
