"""posegrid and other programs on open data, on the fixed splits of a suite.

    python pipelines/benchmarks/benchmark.py pipelines/benchmarks/stations.toml [--arm wam]… [--split halves]… [--out benchmark]
    python pipelines/benchmarks/benchmark.py pipelines/benchmarks/stations.toml --program mine=answers

For each split of each arm:
1. the files are held against their digests, and the rows of both parts written as tables `train` and `test` (`OUT/runs/ARM/SPLIT`); sessions that
   are logs are taken whole;
2. `posegrid run` learns from the one and is judged on the other, with the pipeline file of the arm;
3. what another program needs goes to `OUT/given/ARM/SPLIT`, and `programs/rivals.py` answers to it like any other program: `train.csv` and
   `test.csv` have `station,q1,q2,…` (rad, mm where a joint slides), `x,y,z` where the program may know them (mm), and `gx,gy,gz`, the place by
   posegrid's identified geometry; all in its base frame;
4. a program answers with `ARM/SPLIT.csv`: `station,x,y,z` of every station of `test.csv`, in mm and in the frame of the training, and
   `cxx,cxy,cxz,cyy,cyz,czz` (mm²) where it states the covariance of measured minus predicted;
5. figures of the stations that judge, with intervals by drawing whole blocks of the work space, are printed and written to
   `OUT/benchmark.parquet`.

A split by rows whose test stations stand between training stations leaks, and is named so. Needs numpy, polars, scikit-learn and blake3.
"""

import argparse
import csv
import json
import pathlib
import shutil
import subprocess
import sys
import tomllib

import blake3
import numpy as np
import polars

HERE = pathlib.Path(__file__).parent
# 95 % quantile of chi squared with three degrees of freedom.
INSIDE = 7.814727903
# Blocks of the work space along each axis; fewer blocks than LEAST_BLOCKS give no interval.
BLOCKS, LEAST_BLOCKS = 4, 8
# Draws of blocks, their seed, and the confidence of the intervals.
DRAWS, SEED, CONFIDENCE = 2000, 1, 0.95
# Neighbours of a test station that are looked at, and the part of the share by lot from which a split leaks.
NEIGHBOURS, LEAKS_FROM = 6, {"rows": 0.25, "region": 0.9, "session": float("inf")}
# Predictions this many times as far off as base and target are looked at; after a change of unit or frame within AS_GOOD times they are refused.
WORSE, AS_GOOD = 10, 3
UNITS = {"millimetres": 1, "metres": 1000, "micrometres": 0.001, "centimetres": 10, "inches": 25.4}
NAMES = {
    ("base_target", "reported"): "base and target fitted",
    ("geometric", "reported"): "geometry identified",
    ("full", "weighted"): "full error model",
    ("full", "commanded"): "full error model from commands alone",
}
# What finds the base of the stations that judge, by the word of a suite, and the same in words.
BASES = {"training": "none", "test": "all", "chosen": "chosen"}
WORDS = {
    "none": "base as trained",
    "all": "base fitted to the stations that judge: for comparing models only",
    "first": "base found by listed stations, which do not judge",
    "chosen": "base found by a few stations, which do not judge",
}
# Published figures of programs that fit plain squares of positions, and the model that they are of; the same to a thousandth.
INDEPENDENT = {"base + target, independent code": "base and target fitted", "geometry, independent code": "geometry identified"}
SAME = 1e-3
REFERENCE, BEST = "base and target fitted", "full error model"
COVARIANCE = ["xx", "xy", "xz", "yy", "yz", "zz"]


def numbers(text):
    """The stations of a list like "0-214/2, 300"."""
    found = []
    for part in text.split(","):
        span, _, stride = part.strip().partition("/")
        first, _, last = span.partition("-")
        found += range(int(first), int(last or first) + 1, int(stride or 1))
    return found


def records(path):
    """What stands before the rows of a table, and its rows, as text: lines of CSV, or entries of YAML."""
    lines = path.read_text().splitlines(keepends=True)
    if path.suffix != ".yaml":
        return lines[0], [line for line in lines[1:] if line.strip()]
    rows = []
    for line in lines:
        if line[0] in " -":
            rows[-1] += line
        else:
            rows.append(line)
    return "", rows


def inline(value):
    """A value of TOML on one line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(key)} = {inline(own)}" for key, own in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(inline, value)) + "]"
    return json.dumps(value, ensure_ascii=False)


class Split:
    """One split of one arm: its stations, the run of posegrid on them, and the judgement of every entrant."""

    def __init__(self, suite, arm, split, arguments):
        self.arm, self.split, self.out, self.plain = arm["name"], split["name"], arguments.out, arguments.plain
        self.kind, self.beside = split["kind"], split.get("beside")
        self.published = split.get("published", [])
        self.base = split.get("base", "training")
        (trained, train), (tested, test) = (single(split[part]) for part in ("train", "test"))
        # Stations that find the base come first: `locate` takes the first ones.
        finders = numbers(single(self.base)[1]) if isinstance(self.base, dict) else []
        self.base_refit = "first" if finders else BASES[self.base]
        self.locate = {"by": "first", "stations": len(finders)} if finders else {"by": "chosen"}
        self.rows = {"train": (trained, numbers(train)), "test": (tested, finders + numbers(test))}
        if trained == tested and set(self.rows["train"][1]) & set(self.rows["test"][1]):
            raise SystemExit(f"{self}: a station trains and judges")
        self.sessions = {own["name"]: own for own in arm["session"]}
        self.pipeline = suite.parent / arm["pipeline"]
        self.settings = tomllib.loads(self.pipeline.read_text())
        folder = arguments.data or self.pipeline.parent / self.settings["input"]["folder"]
        self.data = folder / arm.get("folder", "")
        self.source = arm["source"]
        self.folder = self.out / "runs" / self.arm / self.split
        self.given = self.out / "given" / self.arm / self.split

    def __str__(self):
        return f"{self.arm}, {self.split}"

    def checked(self, session):
        """The files of a session, held against their digests."""
        paths = []
        for file in self.sessions[session]["file"]:
            path = self.data / file["path"]
            if not path.exists():
                raise SystemExit(f"{self}: {path} is not there; it is {file.get('origin', 'made')} of {self.source['repository']} ({self.source['licence']})")
            digest = blake3.blake3(path.read_bytes()).hexdigest()
            if digest != file.get("blake3", digest):
                raise SystemExit(f"{self}: {path} has another digest, {digest}, than the suite states: it was altered, or is of another version")
            paths.append(path)
        return paths

    def written(self, part):
        """Writes the table of a part, where its session is a table, and returns the keys of `[input]` that find it."""
        session, stations = self.rows[part]
        paths, count = self.checked(session), self.sessions[session].get("stations")
        if len(paths) > 1:
            if sorted(stations) != list(range(count)):
                raise SystemExit(f"{self}: session {session} is logs, which are taken whole: list all of its {count} stations")
            self.names[part] = session
            return {"folder": str(self.data.resolve())}
        before, rows = records(paths[0])
        if len(rows) != (count or len(rows)):
            raise SystemExit(f"{self}: {paths[0]} has {len(rows)} rows, and the suite's lists are for {count} stations")
        (self.folder / f"{part}{paths[0].suffix}").write_text(before + "".join(rows[own] for own in stations))
        self.names[part] = part
        return {"folder": ".", "sessions_by": "file_name", "stations": "{session}" + paths[0].suffix}

    def run(self, posegrid):
        """Writes the tables of both parts, and has posegrid learn from the one and judge on the other."""
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir(parents=True)
        settings, self.names = self.settings, {}
        for part in self.rows:
            settings["input"] |= self.written(part)
        settings["input"] |= {"sessions": [self.names["train"]], "test": [self.names["test"]]}
        if self.plain:
            fit = settings.setdefault("fit", {})
            fit |= {"prior_length_mm": 0, "prior_angle_mrad": 0, "orientations": False}
        settings["robot"]["file"] = str((self.pipeline.parent / settings["robot"]["file"]).resolve())
        settings["report"] = {"locate": self.locate | {"target": "known"}}
        # The table of commands is not judged here: one step is enough.
        settings["grid"]["steps_mm"] = [max(settings["grid"]["steps_mm"])]
        settings["output"] = {"lake": "lake"}
        pipeline = self.folder / "pipeline.toml"
        pipeline.write_text("".join(f"{key} = {inline(own)}\n" for key, own in settings.items()))
        ran = subprocess.run([posegrid, "run", pipeline], capture_output=True, text=True)
        if ran.returncode not in (0, 3):
            raise SystemExit(f"{self}: {ran.stdout}{ran.stderr}")
        lake = lambda table: polars.read_parquet(self.folder / "lake" / table / "*" / "*" / "*.parquet")
        self.residuals = lake("residuals")
        self.stations = {part: self.measured(lake("stations"), part) for part in self.rows}
        self.finds = self.set_of("test", "base_target", "reported", self.base_refit)["used_for_refit"].to_numpy()

    def measured(self, stations, part):
        """The stations of a part that have a reading: number, joints, measured position and that by the identified geometry, in its base."""
        found = stations.filter(polars.col("session") == self.names[part], polars.col("x_mm").is_not_null()).sort("station")
        if found.height < len(self.rows[part][1]):
            print(f"{self}: {found.height} of the {len(self.rows[part][1])} listed stations of {part} have a reading")
        own = self.set_of(part, "geometric", "reported", "none" if part == "train" else self.base_refit)
        attained = own.select("x_mm", "y_mm", "z_mm").to_numpy()
        return found["station"].to_numpy(), np.array(found["joints_rad"].to_list()), attained, attained - errors_of(own)

    def set_of(self, part, model, angles, base_refit):
        """Residuals of a model at the stations of a part."""
        split = "none" if part == "train" else "session"
        own = {"split": split, "of_session": self.names[part], "model": model, "angles": angles, "base_refit": base_refit}
        return self.residuals.filter(**own).sort("station")

    def export(self):
        """Writes what another program needs: joints, measured positions and those by the identified geometry."""
        self.given.mkdir(parents=True, exist_ok=True)
        shutil.copy(self.settings["robot"]["file"], self.given.parent / "robot.toml")
        for part, (station, joints, position, places) in self.stations.items():
            known = np.full(len(station), True) if part == "train" else self.finds
            with open(self.given / f"{part}.csv", "w", newline="") as file:
                writer = csv.writer(file)
                writer.writerow(["station", *(f"q{1 + own}" for own in range(joints.shape[1])), *"xyz", "gx", "gy", "gz"])
                for row, q, x, g in zip(range(len(station)), joints, position, places):
                    writer.writerow([station[row], *q, *(x if known[row] else [""] * 3), *g])

    def entrants(self, programs):
        """Errors and covariances of each entrant at the stations that judge, mm; without covariances NaN."""
        found = {}
        for (model, angles), name in NAMES.items():
            own = self.set_of("test", model, angles, self.base_refit).filter(~polars.col("used_for_refit"))
            if own.height:
                found[name] = (errors_of(own), covariances_of(own))
            # A base as trained may have moved by the next session, and no covariance says by how much: coverage is that with a base found anew.
            located = self.set_of("test", model, angles, "chosen").filter(~polars.col("used_for_refit"))
            if own.height and located.height and np.isnan(found[name][1]).any():
                self.located[name] = inside(errors_of(located), covariances_of(located)).mean()
        rms = np.sqrt((found[REFERENCE][0] ** 2).sum(1).mean())
        for name, folder in programs.items():
            path = pathlib.Path(folder) / self.arm / f"{self.split}.csv"
            if path.exists():
                found[name] = self.answered(path, rms)
        return found

    def answered(self, path, rms):
        """Errors and covariances of a program's answers."""
        station, _, position, _ = self.stations["test"]
        answers = polars.read_csv(path).sort("station")
        if answers["station"].to_list() != list(station):
            raise SystemExit(f"{path}: its stations are not those of test.csv")
        predicted = answers.select("x", "y", "z").to_numpy().astype(float)
        if not np.isfinite(predicted).all():
            raise SystemExit(f"{path}: a position is no finite number")
        is_found = self.base_refit != "none"
        refuse_unlike(path, position, predicted, rms, is_found)
        if is_found:
            used = self.finds if self.finds.any() else ~self.finds
            predicted = moved(kabsch(position[used], predicted[used]), predicted)
        columns = [f"c{own}" for own in COVARIANCE]
        # The frame of a base that was found anew is another than that of the covariance.
        stated = not is_found and set(columns) <= set(answers.columns)
        covariances = symmetric(answers.select(columns).to_numpy()) if stated else np.full((len(station), 3, 3), np.nan)
        return (position - predicted)[~self.finds], covariances[~self.finds]

    def judge(self, programs):
        """Prints the figures of every entrant, and returns them as rows."""
        self.located = {}
        entrants = self.entrants(programs)
        test = self.set_of("test", "base_target", "reported", self.base_refit).filter(~polars.col("used_for_refit"))
        blocks = blocks_of(test.select("x_mm", "y_mm", "z_mm").to_numpy())
        draws = drawn(blocks)
        share, by_lot, nearest = self.mixed()
        leaks = share >= LEAKS_FROM[self.kind] * by_lot
        trained, judged = len(self.stations["train"][0]), len(blocks)
        print(f"\n{self}: by {self.kind}: {trained} stations train, {judged} judge in {len(set(blocks))} blocks, {WORDS[self.base_refit]}")
        if leaks:
            print(f"  WARNING, it leaks: {share:.0%} of the nearest neighbours of the stations that judge have trained ({np.degrees(nearest):.1f}° away at "
                  f"the median), so it shows interpolation; {self.beside or 'no split'} beside it shows the arm elsewhere")
        norms = {name: np.linalg.norm(errors, axis=1) for name, (errors, _) in entrants.items()}
        print(f"  {'':40}{'mean':>8}{'rms':>8}{'p95':>8}{'max':>8}{'coverage':>10}{'improvement':>13}{'difference':>12}  mean within")
        rows = []
        for name, (errors, covariances) in entrants.items():
            hits = inside(errors, covariances)
            of = lambda own: figures(norms, name, hits, own)
            values, each = of(np.arange(judged)), np.array([list(of(own).values()) for own in draws])
            tails = [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2]
            limits = np.quantile(each, tails, axis=0).T if len(each) else np.full((len(values), 2), np.nan)
            if np.isnan(values["coverage"]):
                values["coverage"] = self.located.get(name, np.nan)
            for (figure, value), (low, high) in zip(values.items(), limits):
                if not np.isnan(value):
                    split = {"robot": self.arm, "split": self.split, "kind": self.kind, "leaks": bool(leaks), "model": name}
                    rows.append(split | {"figure": figure, "value": value, "low": low, "high": high, "stations": judged})
            mean, rms, p95, largest, coverage, improvement, difference = values.values()
            print(f"  {name:40}{mean:8.3f}{rms:8.3f}{p95:8.3f}{largest:8.3f}{shown(coverage, '10.1%')}{improvement:13.1%}"
                  f"{shown(difference, '+12.3f')}  {shown(limits[0][0], '.3f')} to {shown(limits[0][1], '.3f')}")
        for own in self.published:
            print(f"  published: {own['model']}: {own['figure']} {own['value']} ({own['source']})")
        return rows

    def mixed(self):
        """The share of training stations among the nearest neighbours of a test station, that by lot, and the distance of the nearest."""
        train, test = self.stations["train"][1], self.stations["test"][1][~self.finds]
        shares, nearest = [], []
        for place, own in enumerate(test):
            others = np.concatenate([np.delete(test, place, axis=0), train])
            # Test stations come first, and a stable sort keeps them so: a tie is no evidence of a leak.
            order = np.argsort(np.linalg.norm(others - own, axis=1), kind="stable")[:NEIGHBOURS]
            shares.append(np.mean(order >= len(test) - 1))
            nearest.append(np.abs(train - own).max(1).min())
        return np.mean(shares), len(train) / (len(train) + len(test)), np.median(nearest)


def not_as_published(splits, rows):
    """Figures of independent code that posegrid's differ from by a thousandth or more, each in a sentence."""
    own = {(row["robot"], row["split"], row["model"], row["figure"]): row["value"] for row in rows}
    for split in splits:
        for published in split.published:
            model = INDEPENDENT.get(published["model"])
            value = own.get((split.arm, split.split, model, published["figure"]))
            if value and abs(value / published["value"] - 1) >= SAME:
                yield f"{split}: {model}: {published['figure']} {value:.4f}, and {published['value']} by {published['model']}"


def single(parts):
    """The only session of a part with its list."""
    ((session, stations),) = parts.items()
    return session, stations


def shown(value, form):
    """A figure as text; a dash where there is none."""
    return f"{value:{form}}" if np.isfinite(value) else f"{'–':>{form.lstrip('+').split('.')[0] or 1}}"


def errors_of(rows):
    return rows.select([f"residual_{axis}_mm" for axis in "xyz"]).to_numpy()


def covariances_of(rows):
    return symmetric(rows.select([f"predicted_cov_{own}_mm2" for own in COVARIANCE]).to_numpy())


def symmetric(upper):
    """Covariances from the upper triangles by rows."""
    return upper.astype(float)[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)


def inside(errors, covariances):
    """Whether each error is inside its 95 % ellipsoid; NaN without a covariance."""
    if np.isnan(covariances).any():
        return np.full(len(errors), np.nan)
    return np.einsum("ni,ni->n", errors, np.linalg.solve(covariances, errors[..., None])[..., 0]) <= INSIDE


def figures(norms, name, hits, stations):
    """Every figure of the stations: lengths in mm, and shares."""
    own = norms[name][stations]
    mean = {other: norms[other][stations].mean() for other in (REFERENCE, BEST) if other in norms}
    return {
        "mean": own.mean(),
        "rms": np.sqrt((own**2).mean()),
        "p95": np.quantile(own, 0.95),
        "max": own.max(),
        "coverage": hits[stations].mean(),
        "improvement": 1 - own.mean() / mean[REFERENCE],
        "difference": own.mean() - mean.get(BEST, np.nan),
    }


def blocks_of(positions):
    """The number of each position's block of the work space: a quarter of the extent along each axis."""
    low, size = positions.min(0), np.ptp(positions, axis=0) / BLOCKS
    cells = np.floor((positions - low) / np.where(size > 0, size, 1)).astype(int)
    return np.unique(cells, axis=0, return_inverse=True)[1].ravel()


def drawn(blocks):
    """The stations of each draw of as many blocks as there are: neighbours share their errors, so they are drawn together."""
    members = [np.flatnonzero(blocks == own) for own in np.unique(blocks)]
    lot = np.random.default_rng(SEED)
    enough = len(members) >= LEAST_BLOCKS
    return [np.concatenate([members[own] for own in lot.integers(len(members), size=len(members))]) for _ in range(DRAWS * enough)]


def kabsch(to, source):
    """Rotation and shift that move `source` onto `to` with the least sum of squares."""
    middle, other = to.mean(0), source.mean(0)
    u, _, vt = np.linalg.svd((to - middle).T @ (source - other))
    turn = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
    return turn, middle - turn @ other


def moved(frame, positions):
    turn, shift = frame
    return positions @ turn.T + shift


def refuse_unlike(path, position, predicted, rms, is_found):
    """Refuses predictions that are in another unit or frame than asked for."""
    def off(of):
        return np.sqrt(((position - of) ** 2).sum(1).mean())

    aligned = lambda of: moved(kabsch(position, of), of)
    if off(aligned(predicted) if is_found else predicted) <= WORSE * rms:
        return
    for unit, mm in UNITS.items():
        for frame, of in (("that of the training", mm * predicted), ("another", aligned(mm * predicted))):
            if off(of) <= AS_GOOD * rms:
                raise SystemExit(f"{path}: predictions look like {unit} in {frame} frame: state them in mm, in the frame of the training positions")


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("suite", type=pathlib.Path)
    arguments.add_argument("--posegrid", default="posegrid", help="the program")
    arguments.add_argument("--data", type=pathlib.Path, help="the folder with the data, instead of that of the pipeline files")
    arguments.add_argument("--arm", action="append", help="only this arm; may be given several times")
    arguments.add_argument("--split", action="append", help="only this split; may be given several times")
    arguments.add_argument("--program", action="append", default=[], metavar="NAME=DIR", help="another program with its answers")
    arguments.add_argument("--plain", action="store_true", help="fit positions alone without a prior, no rivals, and fail where published figures differ")
    arguments.add_argument("--out", type=pathlib.Path, default="benchmark", help="the folder of runs, of what programs need, and of the figures")
    own = arguments.parse_args()
    suite = tomllib.loads(own.suite.read_text())
    splits = [
        Split(own.suite, arm, split, own)
        for arm in suite["arm"]
        for split in arm["split"]
        if arm["name"] in (own.arm or [arm["name"]]) and split["name"] in (own.split or [split["name"]])
    ]
    answers = own.out / "rivals"
    for folder in (own.out / "given", answers):
        shutil.rmtree(folder, ignore_errors=True)
    for split in splits:
        split.run(own.posegrid)
        split.export()
    answers.mkdir(parents=True)
    if not own.plain:
        subprocess.run([sys.executable, HERE / "programs" / "rivals.py", own.out / "given", answers], check=True)
    programs = {path.name.replace("_", " "): path for path in sorted(answers.iterdir())}
    programs |= dict(program.split("=", 1) for program in own.program)
    rows = [row for split in splits for row in split.judge(programs)]
    polars.DataFrame(rows).with_columns(suite=polars.lit(suite["name"])).write_parquet(own.out / "benchmark.parquet")
    print(f"\nwritten: {own.out / 'benchmark.parquet'}")
    if own.plain and (wrong := list(not_as_published(splits, rows))):
        raise SystemExit("\n".join(wrong))


if __name__ == "__main__":
    main()
