"""Works ISO 9283's figures out again from a lake, in plain Python, and holds table `accuracy` against them.

    python tests/readers/iso_9283.py poses > poses.csv      # poses for `posegrid simulate --poses`: five visited again and again
    python tests/readers/iso_9283.py check LAKE

Which stations visited one pose is told from `stations`; commanded and attained positions are those of `residuals`, so every
figure of the raw command, of a session that a table drove and of the full error model from commands is worked out again. Of base
and target fitted the lake has no residuals against the command: there the tool is placed by the frames in `calibrations` and
what the tracker saw, where it saw orientations too. Poses, pairs and groups are found here by rules of their own wording, and
every row of those subjects has to be met.
"""

import argparse
import collections
import itertools
import math
import pathlib
import statistics
import sys

import pyarrow.parquet

HOME = (0, -75, 100, 25, 55, -15)
# Offsets from home in degrees: the middle and four corners.
FIVE = [(0, 0, 0, 0, 0, 0), (12, 6, -6, 5, 4, -5), (-12, 6, -6, -5, 4, 5), (12, -6, 6, 5, -4, 5), (-12, -6, 6, -5, -4, -5)]
OTHERS, CYCLES = 60, 8
WITHIN = 1e-9


def poses():
    """Sixty other poses, then the five in turn, forwards and backwards."""
    spread = [[14 * math.sin(1.7 * place * math.sqrt(prime)) for prime in (2, 3, 5, 7, 11, 13)] for place in range(1, OTHERS + 1)]
    visits = [FIVE if cycle % 2 == 0 else FIVE[::-1] for cycle in range(CYCLES)]
    print("target," + ",".join(f"q{joint}_deg" for joint in range(1, 7)))
    for number, offsets in enumerate(itertools.chain(spread, *visits)):
        print(f"p{number}," + ",".join(f"{home + offset:.6f}" for home, offset in zip(HOME, offsets)))


def rows(lake, table):
    for file in sorted((lake / table).glob("*/*/*.parquet")):
        yield from pyarrow.parquet.read_table(file).to_pylist()


def vector(row, names):
    return tuple(row[name] for name in names)


def minus(a, b):
    return tuple(x - y for x, y in zip(a, b))


def middle(vectors):
    return tuple(statistics.fmean(axis) for axis in zip(*vectors))


def conjugate(q):
    return (-q[0], -q[1], -q[2], q[3])


def product(a, b):
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def turn(q):
    """The rotation vector of a quaternion."""
    q = q if q[3] >= 0 else tuple(-part for part in q)
    sine = math.hypot(*q[:3])
    return tuple(0.0 if sine == 0 else part / sine * 2 * math.atan2(sine, q[3]) for part in q[:3])


def one_pose(a, b):
    """Whether two dwells went to one pose: one command, one way to stand there."""
    position = ("command_x_mm", "command_y_mm", "command_z_mm")
    orientation = ("command_qx", "command_qy", "command_qz", "command_qw")
    if a[position[0]] is None or b[position[0]] is None or math.dist(vector(a, position), vector(b, position)) > 0.01:
        return False
    if (a[orientation[0]] is None) != (b[orientation[0]] is None):
        return False
    if a[orientation[0]] is not None:
        apart = turn(product(vector(b, orientation), conjugate(vector(a, orientation))))
        if math.hypot(*apart) > math.radians(0.01):
            return False
    return all(abs(x - y) <= math.radians(1) for x, y in zip(a["joints_rad"], b["joints_rad"]))


def pose_of(stations):
    """The first station of the pose that each station visits."""
    firsts, poses = [], {}
    for station in sorted(stations, key=lambda station: station["station"]):
        if station["command_x_mm"] is None:
            continue
        first = next((first for first in firsts if one_pose(first, station)), station)
        if first is station:
            firsts.append(station)
        poses[station["station"]] = first["station"]
    return poses


class Visit:
    def __init__(self, station, come_from, commanded, attained, turned=None):
        self.station, self.come_from, self.commanded, self.attained = station, come_from, commanded, attained
        self.error = minus(attained, commanded)
        self.turned = turned  # commanded and attained orientation


def of_residual(station, come_from, row):
    attained = vector(row, ("x_mm", "y_mm", "z_mm"))
    error = vector(row, ("residual_x_mm", "residual_y_mm", "residual_z_mm"))
    return Visit(station, come_from, minus(attained, error), attained)


def off(visits):
    return math.hypot(*middle([visit.error for visit in visits]))


def of_pose(visits, everything):
    error = middle([visit.error for visit in visits])
    found = {"AP_p": math.hypot(*error), "AP_x": error[0], "AP_y": error[1], "AP_z": error[2]}
    if not everything:
        return found
    centre = middle([visit.attained for visit in visits])
    away = [math.dist(visit.attained, centre) for visit in visits]
    found["RP_l"] = statistics.fmean(away) + 3 * statistics.stdev(away)
    if all(visit.turned for visit in visits):
        found.update(of_turns([visit.turned for visit in visits]))
    approaches = collections.defaultdict(list)
    for visit in visits:
        if visit.come_from is not None:
            approaches[visit.come_from].append(visit.attained)
    centres = [middle(approach) for approach in approaches.values() if len(approach) > 1]
    if len(centres) > 1:
        found["vAP_p"] = max(math.dist(a, b) for a, b in itertools.combinations(centres, 2))
    group = min(10, len(visits) // 2)
    if group > 1:
        found["dAP_p"] = abs(off(visits[-group:]) - off(visits[:group]))
    return found


def in_turn(a, b):
    """Visits of two poses that follow one another, each once."""
    order = sorted([(visit.station, 0, visit) for visit in a] + [(visit.station, 1, visit) for visit in b])
    pairs, last = [], None
    for _, side, visit in order:
        if last and last[0] != side:
            pairs.append((visit, last[1]) if side == 0 else (last[1], visit))
            last = None
        else:
            last = (side, visit)
    return pairs


def of_distance(poses, everything):
    best = None
    for a, b in itertools.combinations(sorted(poses), 2):
        pairs = in_turn(poses[a], poses[b])
        if len(pairs) > 1:
            apart = math.hypot(*middle([minus(two.commanded, one.commanded) for one, two in pairs]))
            if apart >= 100 and (best is None or (len(pairs), apart) > best[0]):
                best = ((len(pairs), apart), pairs)
    if best is None:
        return {"AD_p": None} if everything else {}
    (_, apart), pairs = best
    commanded = middle([minus(two.commanded, one.commanded) for one, two in pairs])
    attained = [minus(two.attained, one.attained) for one, two in pairs]
    distances = [math.hypot(*way) for way in attained]
    found = {"AD_p": statistics.fmean(distances) - apart}
    for axis, name in enumerate(("AD_x", "AD_y", "AD_z")):
        found[name] = statistics.fmean(abs(way[axis]) for way in attained) - abs(commanded[axis])
    if everything:
        found["RD"] = 3 * statistics.stdev(distances)
    return found


def expected(poses, everything):
    """All figures of one subject by pose and name; None over all poses."""
    found = {(pose, name): value for pose, visits in poses.items() for name, value in of_pose(visits, everything).items()}
    for name in ("AP_p", "RP_l", "RP_a", "RP_b", "RP_c", "vAP_p", "dAP_p"):
        values = [value for (_, own), value in found.items() if own == name]
        if values:
            found[None, name] = max(values)
        elif everything and name not in ("RP_a", "RP_b", "RP_c"):
            found[None, name] = None
    found.update({(None, name): value for name, value in of_distance(poses, everything).items()})
    return found


SUBJECT = ("robot", "run", "of_session", "split", "model", "angles", "base_refit")


def is_evidence(row):
    held_against_command = row["angles"] == "commanded" and row["base_refit"] != "all"
    return held_against_command and (row["model"] in ("raw_command", "table") or row["split"] != "none")


def of_subjects(lake):
    """Visits of each subject by pose."""
    stations = collections.defaultdict(dict)
    for row in rows(lake, "stations"):
        stations[row["robot"], row["run"], row["session"]][row["station"]] = row
    poses = {key: pose_of(own.values()) for key, own in stations.items()}
    subjects = collections.defaultdict(lambda: collections.defaultdict(list))
    for row in rows(lake, "residuals"):
        key, station = vector(row, ("robot", "run", "of_session")), row["station"]
        if is_evidence(row) and not row["used_for_refit"] and station in poses[key]:
            visit = of_residual(station, poses[key].get(station - 1), row)
            subjects[vector(row, SUBJECT)][poses[key][station]].append(visit)
    for subject, own in subjects.items():
        again = {pose: sorted(visits, key=lambda v: v.station) for pose, visits in own.items() if len(visits) > 1}
        if again:
            yield subject, again
    yield from of_base_and_target(lake, stations, poses)


def rotated(q, point):
    return product(product(q, (*point, 0.0)), conjugate(q))[:3]


def mean_turn(attained):
    mean = attained[0]
    for _ in range(5):
        step = middle([turn(product(conjugate(mean), q)) for q in attained])
        half = math.hypot(*step) / 2
        scale = 0.5 if half == 0 else math.sin(half) / (2 * half)
        mean = product(mean, (*(scale * part for part in step), math.cos(half)))
    return mean


def of_turns(turned):
    commanded, attained = turned[0][0], [attained for _, attained in turned]
    mean = mean_turn(attained)
    found = dict(zip(("AP_a", "AP_b", "AP_c"), turn(product(mean, conjugate(commanded)))))
    away = [turn(product(q, conjugate(mean))) for q in attained]
    for axis, name in enumerate(("RP_a", "RP_b", "RP_c")):
        found[name] = 3 * math.sqrt(sum(vector[axis] ** 2 for vector in away) / (len(away) - 1))
    return found


def of_base_and_target(lake, stations, poses):
    """Visits of the tool in the fitted base, of sessions that a run was trained on alone and whose orientations were seen."""
    for row in rows(lake, "calibrations"):
        key = row["robot"], row["run"], row["session"]
        if row["model_kind"] != "base_target" or key not in stations:
            continue
        frames = ("tracker_from_base", "flange_from_target", "flange_from_tool", "command_from_base")
        placed = {name: (vector(row, [f"{name}_{a}_mm" for a in "xyz"]), vector(row, [f"{name}_q{a}" for a in "xyzw"])) for name in frames}
        (base, base_q), (target, target_q), (tool, tool_q), (command, command_q) = (placed[name] for name in frames)
        lever = minus(tool, target)
        visited = collections.defaultdict(list)
        for number, pose in sorted(poses[key].items()):
            station = stations[key][number]
            if station["verdict"] != "paired" or station["qx"] is None:
                continue
            seen = rotated(conjugate(base_q), minus(vector(station, ("x_mm", "y_mm", "z_mm")), base))
            seen_q = vector(station, ("qx", "qy", "qz", "qw"))
            flange_q = product(product(conjugate(base_q), seen_q), conjugate(target_q))
            attained = tuple(a + b for a, b in zip(seen, rotated(flange_q, lever)))
            commanded = minus(vector(station, ("command_x_mm", "command_y_mm", "command_z_mm")), command)
            commanded_q = vector(station, ("command_qx", "command_qy", "command_qz", "command_qw"))
            turned = product(conjugate(command_q), commanded_q), product(flange_q, tool_q)
            come_from = poses[key].get(number - 1)
            visited[pose].append(Visit(number, come_from, rotated(conjugate(command_q), commanded), attained, turned))
        again = {pose: visits for pose, visits in visited.items() if len(visits) > 1}
        if again:
            yield (*key, "none", "base_target", "commanded", "none"), again


def check(lake):
    table = collections.defaultdict(dict)
    for row in rows(lake, "accuracy"):
        if row["quantity"] == "iso_9283":
            table[vector(row, SUBJECT)][row["pose"], row["name"]] = row["value"]
    problems, met = [], 0
    for subject, own in of_subjects(lake):
        given, wanted = table.pop(subject, {}), expected(own, subject[4] in ("raw_command", "table", "base_target"))
        told = {pose for pose, _ in given if pose is not None}
        wanted = {key: value for key, value in wanted.items() if key[0] is None or key[0] in told}
        if given.keys() != wanted.keys():
            problems.append(f"{subject}: {sorted(map(str, given.keys() ^ wanted.keys()))} on one side alone")
        for key in given.keys() & wanted.keys():
            met += 1
            if (given[key] is None) != (wanted[key] is None) or given[key] is not None and abs(given[key] - wanted[key]) > WITHIN:
                problems.append(f"{subject}, {key}: {given[key]} in the table, worked out {wanted[key]}")
    problems.extend(f"{subject}: only in the table" for subject in table if subject[4] != "base_target")
    if met == 0:
        problems.append(f"{lake}: no figure of ISO 9283 to work out again")
    print(f"{met} figures of ISO 9283 worked out again, {len(problems)} problems")
    for problem in problems[:20]:
        print(f"PROBLEM {problem}", file=sys.stderr)
    return 1 if problems else 0


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = arguments.add_subparsers(dest="command", required=True)
    commands.add_parser("poses")
    commands.add_parser("check").add_argument("lake", type=pathlib.Path)
    given = arguments.parse_args()
    if given.command == "poses":
        return poses()
    return check(given.lake)


if __name__ == "__main__":
    sys.exit(main())
