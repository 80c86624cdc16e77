"""Whole robot programs on a robot of our own: what the user of a corrected program gets along its path, by a program that shares no code with it.

    python tests/readers/programs.py target/debug/posegrid --seed 1 --seed 2

For each seed an arm of `independent_arm.py` is recorded and identified as there. A part lies in its box, with a base that was surveyed or
that was touched with this wrong arm (three points of KUKA and FANUC, ABB's user frame likewise), and a program in KRL, one in RAPID and a listing of FANUC
move over it: joint motions, straight ones, circles; a script of Universal Robots goes to its poses by joint angles. FANUC's session and program are
of a controller that counts the joints of the same arm as FANUC does, joint 3 against the horizontal, in a world at the height of axis 2, and a
script with poses is of one that has the same arm in a calibration file of Universal Robots. For each dialect and each way of finding the base
1. `posegrid compensate` corrects the program;
2. a small interpreter runs the original and the corrected text: the controller knows the nominal arm, moves its tool straight, on a circle
   or by joints between the poses of the text in the base of its numbers, and sends the joints to the wrong arm;
3. what the arm attains is held against the path that the original means on the part, at places along all of its motions.
The program in a surveyed base is corrected once more with `--densify`, and has to keep to its path with the further points too, whose motions
have to be circles where the motion is one.

A line is printed for each. The exit code is 1 where a position is not corrected, where fewer than 95 % of the places of all seeds lie within
the bound that the run promises of poses and what the report states between these, or where a program is worse after its correction than before. Of a base that was touched it is shown too what a
correction that takes it as surveyed would leave.
"""

import argparse
import pathlib
import re
import sys

import duckdb
import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import independent_arm as cell  # noqa: E402

ROOT = cell.ROOT
PLACES = 12  # along each motion
PARTS = 4  # places of the part in the box of each arm: what is left of an arm's error is alike over one part
DENSIFY_MM = 0.0005  # small enough that straight motions and most circles get further points
ADDED = "added by posegrid"
OWN = "posegrid"  # the comment of positions that were added to a listing
ALLOW = "tool payload mounting base controller-model absolute-accuracy temperature".split()
START = cell.HOME
RAPID_NO = "[9E9,9E9,9E9,9E9,9E9,9E9]"


def pose(turned, place):
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = turned, place
    return made


def inverse(made):
    back = made[:3, :3].T
    return pose(back, -back @ made[:3, 3])


def abc(degrees):
    """Rz(A) Ry(B) Rx(C) of KUKA."""
    a, b, c = np.radians(degrees)
    return cell.turn([0, 0, 1], a) @ cell.turn([0, 1, 0], b) @ cell.turn([1, 0, 0], c)


def as_abc(turned):
    b = np.arctan2(-turned[2, 0], np.hypot(turned[0, 0], turned[1, 0]))
    a, c = np.arctan2(turned[1, 0], turned[0, 0]), np.arctan2(turned[2, 1], turned[2, 2])
    return np.degrees([a, b, c])


def as_quaternion(turned):
    """Real part first."""
    vector = cell.rotation_vector(turned[None])[0]
    angle = np.linalg.norm(vector)
    axis = vector / angle if angle > 1e-12 else np.zeros(3)
    return np.array([np.cos(angle / 2), *(np.sin(angle / 2) * axis)])


def nominal():
    arm = cell.Arm()
    arm.tool = cell.TOOL
    return arm


def tool_pose(arm, joints):
    turned, place = arm.tool_pose(np.asarray(joints)[None])
    return pose(turned[0], place[0])


def reach(arm, wanted, near):
    """Joint angles of an arm for a pose of its tool, by Newton's steps from others."""
    joints = np.array(near, float)

    def off(at):
        there = tool_pose(arm, at)
        turned = cell.rotation_vector((there[:3, :3] @ wanted[:3, :3].T)[None])[0]
        return np.concatenate([there[:3, 3] - wanted[:3, 3], turned * 1e3])

    for _ in range(60):
        error = off(joints)
        if np.abs(error).max() < 1e-8:
            return joints
        columns = [(off(joints + step) - error) / 1e-6 for step in 1e-6 * np.eye(6)]
        step = np.linalg.solve(np.stack(columns, axis=1), error)
        joints = joints - step * min(1, 0.3 / np.abs(step).max())
    raise SystemExit("the arm does not reach a pose of the program")


def between(first, second, share):
    """The shortest turn from one orientation to another, by a share of it, and the straight line between the places."""
    vector = cell.rotation_vector((second[:3, :3] @ first[:3, :3].T)[None])[0]
    angle = np.linalg.norm(vector)
    turned = cell.turn(vector / angle, share * angle) if angle > 1e-12 else np.eye(3)
    return pose(turned @ first[:3, :3], first[:3, 3] + share * (second[:3, 3] - first[:3, 3]))


def on_circle(first, helper, last, share):
    """A pose on the circle through three places, its orientation turned evenly from the first to the last."""
    a, b = helper[:3, 3] - first[:3, 3], last[:3, 3] - first[:3, 3]
    normal = np.cross(a, b)
    centre = first[:3, 3] + np.cross(a @ a * b - b @ b * a, normal) / (2 * normal @ normal)
    axis = normal / np.linalg.norm(normal)
    start, end = first[:3, 3] - centre, last[:3, 3] - centre
    angle = np.arctan2(axis @ np.cross(start, end), start @ end) % (2 * np.pi)
    made = between(first, last, share)
    made[:3, 3] = centre + cell.turn(axis, share * angle) @ start
    return made


# What an interpreter of either dialect gives: motions (joints | straight | circle | by joints, poses in the base).


def numbers(text):
    return [float(number) for number in re.findall(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", text)]


def fields(text):
    found = {name.upper(): float(value) for name, value in re.findall(r"\b([A-Z]\w*)\s+([-+]?[\d.]+(?:[eE][-+]?\d+)?)", text, re.I)}
    if "A1" in found:
        return np.radians([found[f"A{joint}"] for joint in range(1, 7)])
    return pose(abc([found["A"], found["B"], found["C"]]), [found[axis] for axis in "XYZ"])


def read_krl(files):
    """Base, tool and motions of a module: declared positions, literals in motions, BASE_DATA and TOOL_DATA by BAS."""
    values = {}
    for text in files.values():
        for name, value in re.findall(r"^\s*(?:DECL\s+)?(?:GLOBAL\s+)?(?:\w+\s+)?([$\w]+(?:\[\d+\])?)\s*=\s*(\{[^}]*\})", text, re.M):
            values[name.upper()] = fields(value)
    base, tool, motions = None, None, []
    (source,) = (text for name, text in files.items() if name.endswith(".src"))
    further = []
    for line in source.splitlines():
        is_further = ADDED in line
        line = line.split(";")[0].strip()
        chosen = re.match(r"BAS\s*\(\s*#(BASE|TOOL)\s*,\s*(\d+)\s*\)", line)
        if chosen and chosen[1] == "BASE":
            base = values[f"BASE_DATA[{chosen[2]}]"]
        elif chosen:
            tool = values[f"TOOL_DATA[{chosen[2]}]"]
        moved = re.match(r"(PTP|LIN|CIRC)\s+(.*?)(?:\s+C_(?:DIS|PTP))?$", line)
        if moved:
            given = re.findall(r"\{[^}]*\}|\w+", moved[2])
            given = [fields(own) if own.startswith("{") else values[own.upper()] for own in given]
            word = {"PTP": "by joints", "LIN": "straight", "CIRC": "circle"}[moved[1]]
            given = further + given
            further = given if is_further else []
            if not is_further:
                motions.append(("joints" if given[0].ndim == 1 else word, given))
    return base, tool, motions


def brackets(text):
    """Nested lists of a RAPID aggregate, as numbers."""
    return eval(re.sub(r"\b(TRUE|FALSE)\b", lambda own: own[0].title(), text), {"__builtins__": {}})


def of_quaternion(parts):
    return cell.quaternion_turn(np.array([*parts[1:], parts[0]]))


def read_rapid(files):
    (text,) = (text for name, text in files.items() if name.endswith(".mod"))
    text = "\n".join(line.split("!")[0] for line in text.replace(f"; ! {ADDED}", " ADDED;").splitlines())
    values = {name.lower(): brackets(value) for name, value in re.findall(r"(?:CONST|PERS)\s+\w+\s+(\w+)\s*:=\s*(\[[^;]*\]);", text)}

    def point(own):
        own = brackets(own) if own.startswith("[") else values[own.lower()]
        return np.radians(own[0]) if len(own) == 2 else pose(of_quaternion(own[1]), own[0])

    base, tool, motions, further = None, None, [], []
    for word, rest in re.findall(r"^\s*(MoveAbsJ|MoveJ|MoveL|MoveC)\s+([^;]*);", text, re.M):
        is_further, rest = rest.endswith(" ADDED"), rest.removesuffix(" ADDED")
        parts = re.split(r",(?![^\[]*\])", re.sub(r"\\WObj:=(\w+)", r",\1", rest))
        count = 2 if word == "MoveC" else 1
        *_, tool_name, object_name = parts
        frame = values[tool_name.lower()][1]
        tool = pose(of_quaternion(frame[1]), frame[0])
        user, inner = values[object_name.lower()][3:5]
        base = pose(of_quaternion(user[1]), user[0]) @ pose(of_quaternion(inner[1]), inner[0])
        way = {"MoveAbsJ": "joints", "MoveJ": "by joints", "MoveL": "straight", "MoveC": "circle"}[word]
        given = further + [point(own) for own in (rest_points(rest) if "[" in rest else parts[:count])]
        further = given if is_further else []
        if not is_further:
            motions.append((way, given))
    return base, tool, motions


def rest_points(rest):
    """Positions that stand in their instruction."""
    found, depth, begin = [], 0, 0
    for at, sign in enumerate(rest):
        if sign == "[":
            begin = at if depth == 0 else begin
            depth += 1
        elif sign == "]":
            depth -= 1
            if depth == 0:
                found.append(rest[begin : at + 1])
    return found


def run(motions, base):
    """Joints that the controller sends, at places along each motion: it has the nominal arm, and its base stands where `base` says."""
    arm, joints, sent = nominal(), START, []
    for way, points in motions:
        first, begin = tool_pose(arm, joints), joints
        if way == "joints":
            end = points[0]
        else:
            poses = [base @ own for own in points]
            end = reach(arm, poses[-1], joints)
        for number in range(1, PLACES + 1):
            share = number / PLACES
            if way in ("joints", "by joints"):
                joints = begin + share * (end - begin)
            else:
                # Further points cut the way into equal shares; each of a circle is one with its own helper.
                each, way_there = (1, between) if way == "straight" else (2, on_circle)
                stops, along = [first, *poses], share * len(poses) / each
                part = min(int(along), len(poses) // each - 1)
                joints = reach(arm, way_there(*stops[part * each : (part + 1) * each + 1], along - part), joints)
            sent.append(joints)
    return np.array(sent)


# Programs.


def points(generator, part):
    """Poses of a program in its base, mm: a frame of 240 × 240 mm on the part, its circle, and how the tool stands on it."""
    turned = part[:3, :3].T @ cell.quaternion_turn(cell.ORIENTATION)
    flat = [(20, 20), (240, 20), (240, 240), (130, 260), (20, 240), (60, 130), (200, 120)]
    return [pose(turned, [x + generator.uniform(-15, 15), y + generator.uniform(-15, 15), generator.uniform(-20, 40)]) for x, y in flat]


WAYS = [("by joints", [0]), ("straight", [1]), ("straight", [2]), ("circle", [3, 4]), ("by joints", [5]), ("straight", [6]), ("straight", [0])]


def krl_pose(own, joints=None, decimals=3):
    a, b, c = as_abc(own[:3, :3])
    x, y, z = own[:3, 3]
    text = f"X {x:.{decimals}f},Y {y:.{decimals}f},Z {z:.{decimals}f},A {a:.5f},B {b:.5f},C {c:.5f}"
    if joints is not None:
        # Bit 1 of S: axis 3 beyond the stretched arm; bit 2: A5 negative. T: the joints that are negative.
        status = 2 * int(joints[2] > 0) + 4 * int(joints[4] < 0)
        text += f",S {status},T {sum(1 << joint for joint in range(6) if joints[joint] < 0)}"
    return "{" + text + "}"


def write_krl(poses, base, start):
    joints = [reach(nominal(), base @ own, START) for own in poses]
    begin = ",".join(f"A{joint + 1} {degrees:.4f}" for joint, degrees in enumerate(np.degrees(start)))
    lines = ["&ACCESS RVP", "DEF part( )", "BAS(#BASE,1)", "BAS(#TOOL,1)", f"PTP {{{begin}}}"]
    for number, (way, which) in enumerate(WAYS):
        word = {"by joints": "PTP", "straight": "LIN", "circle": "CIRC"}[way]
        # Some positions are declared, some written out; the second visit of one is one of the declared.
        given = [f"XP{own}" if own < 4 else krl_pose(poses[own], joints[own] if way == "by joints" else None) for own in which]
        lines.append(f"{word} {','.join(given)}  ; motion {number}")
    declared = [f"DECL E6POS XP{own}={krl_pose(poses[own], joints[own])}" for own in range(4)]
    frame = lambda own: krl_pose(own, decimals=4)
    return {
        "part.src": "\r\n".join([*lines, "END", ""]),
        "part.dat": "\r\n".join(["DEFDAT part", *declared, "ENDDAT", ""]),
        "$config.dat": "\r\n".join(
            ["DEFDAT $CONFIG", f"BASE_DATA[1]={frame(base)}", f"TOOL_DATA[1]={frame(pose(np.eye(3), cell.TOOL))}", "ENDDAT", ""]
        ),
        "$machine.dat": f"DEFDAT $MACHINE PUBLIC\r\n$ROBROOT={frame(np.eye(4))}\r\nENDDAT\r\n",
    }


def rapid_frame(own, decimals=4):
    q = as_quaternion(own[:3, :3])
    return f"[[{','.join(f'{x:.{decimals}f}' for x in own[:3, 3])}],[{','.join(f'{x:.8f}' for x in q)}]]"


def rapid_pose(own, joints):
    quarters = [int(np.floor(np.degrees(joints[joint]) / 90)) for joint in (0, 3, 5)]
    return f"[{rapid_frame(own, 3)[1:-1]},[{','.join(map(str, quarters))},0],{RAPID_NO}]"


def write_rapid(poses, base, start):
    joints = [reach(nominal(), base @ own, START) for own in poses]
    begin = f"[[{','.join(f'{degrees:.4f}' for degrees in np.degrees(start))}],{RAPID_NO}]"
    lines = ["MODULE Part"]
    lines.append(f"  PERS tooldata tTip:=[TRUE,{rapid_frame(pose(np.eye(3), cell.TOOL))},[1,[0,0,1],[1,0,0,0],0,0,0]];")
    lines.append(f'  PERS wobjdata wPart:=[FALSE,TRUE,"",{rapid_frame(base)},[[0,0,0],[1,0,0,0]]];')
    lines += [f"  CONST robtarget p{own}:={rapid_pose(poses[own], joints[own])};" for own in range(4)]
    lines += ["  PROC main()", f"    MoveAbsJ {begin},v100,fine,tTip\\WObj:=wPart;"]
    for way, which in WAYS:
        word = {"by joints": "MoveJ", "straight": "MoveL", "circle": "MoveC"}[way]
        declared = all(own < 4 for own in which)
        given = [f"p{own}" if declared else rapid_pose(poses[own], joints[own]) for own in which]
        lines.append(f"    {word} {','.join(given)},v100,fine,tTip\\WObj:=wPart;")
    return {"part.mod": "\r\n".join([*lines, "  ENDPROC", "ENDMODULE", ""])}


def write_urscript(poses, base, start):
    """Joint angles alone: poses of a `.script` ask for the calibration that a controller of Universal Robots has of its own arm."""
    joints = [start, *(reach(nominal(), base @ own, start) for own in poses)]
    listed = lambda own: "[" + ", ".join(f"{angle:.7f}" for angle in own) + "]"
    lines = ["def Part():", f"  set_tcp(p[{', '.join(f'{mm / 1e3:.6f}' for mm in cell.TOOL)}, 0.0, 0.0, 0.0])", f"  global Over_q={listed(joints[1])}"]
    lines += [f"  movej({'Over_q' if number == 1 else listed(own)}, a=1.4, v=1.05) # motion {number}" for number, own in enumerate(joints)]
    return {"part.script": "\n".join([*lines, "end", ""])}


def read_urscript(files):
    text = re.sub(r"#.*", "", files["part.script"])
    tool = numbers(re.search(r"set_tcp\(p\[(.*?)\]", text)[1])
    values = {name: numbers(own) for name, own in re.findall(r"global (\w+)=\[(.*?)\]", text)}
    given = re.findall(r"movej\((?:\[(.*?)\]|(\w+))", text)
    motions = [("joints", [np.array(numbers(own) if own else values[name])]) for own, name in given]
    return np.eye(4), pose(np.eye(3), 1e3 * np.array(tool[:3])), motions


# What a controller of FANUC counts of the same arm: KUKA's angles are SIGNS of its own turned by ZEROS, joint 3 against the horizontal.
SIGNS = np.array([[-1, 0, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0], [0, -1, -1, 0, 0, 0], [0, 0, 0, 1, 0, 0], [0, 0, 0, 0, -1, 0], [0, 0, 0, 0, 0, 1]])
ZEROS = np.radians([0, -90, 90, 0, 0, 0])
WORLD = pose(np.eye(3), [0, 0, 675])  # in the arm's base


def as_fanuc(joints):
    return (np.asarray(joints) - ZEROS) @ np.linalg.inv(SIGNS).T


def fanuc_robot(folder):
    """The robot file of that arm."""
    text = (ROOT / "pipelines/robots/kr210-r2700-extra.toml").read_text()
    head, *joints = text.split("[[joint]]")
    head = re.sub(r"home_deg = .*", "home_deg = [0.0, 0.0, 0.0, 0.0, -90.0, 0.0]", head)
    coupled = np.eye(6, dtype=int)
    coupled[2, 1] = 1
    head = head.replace("\n\n", f"\njoint_map = {coupled.tolist()}\n\n")
    signs, zeros, limits = [1, 1, -1, -1, -1, -1], [0, -90, 180, 0, 0, 0], [185, 90, 180, 350, 125, 350]
    for place, (sign, zero, limit) in enumerate(zip(signs, zeros, limits)):
        joints[place] = re.sub(r"sign = .*", f"sign = {sign}", joints[place])
        joints[place] = re.sub(r"offset_deg = .*", f"offset_deg = {zero}", joints[place])
        joints[place] = re.sub(r"limits_deg = .*", f"limits_deg = [-{limit}, {limit}]", joints[place])
    (folder / "fanuc.toml").write_text("[[joint]]".join([head, *joints]))
    return folder / "fanuc.toml"


def write_fanuc(poses, base, start):
    """The places of its frames stand on the controller, and in the file of the cell."""
    lines = ["UFRAME_NUM=1", "UTOOL_NUM=1", "J P[8] 20% FINE"]
    for way, which in WAYS:
        word, speed = {"by joints": ("J", "20%"), "straight": ("L", "100mm/sec"), "circle": ("C", "100mm/sec")}[way]
        lines.append(f"{word} " + "    \r\n    :  ".join(f"P[{own + 1}]" for own in which) + f" {speed} FINE")
    listed = []
    for number, own in enumerate(poses, 1):
        r, p, w = as_abc(own[:3, :3])
        x, y, z = own[:3, 3]
        listed.append(
            f"P[{number}]{{\r\n   GP1:\r\n\tUF : 1, UT : 1,\t\tCONFIG : 'N U T, 0, 0, 0',\r\n\tX = {x:9.3f}  mm,\tY = {y:9.3f}  mm,"
            f"\tZ = {z:9.3f}  mm,\r\n\tW = {w:9.3f} deg,\tP = {p:9.3f} deg,\tR = {r:9.3f} deg\r\n}};"
        )
    begin = [f"J{joint}= {degrees:9.3f} deg" for joint, degrees in enumerate(np.degrees(as_fanuc(start)), 1)]
    listed.append("P[8]{\r\n   GP1:\r\n\tUF : 1, UT : 1,\t\r\n\t" + ",\t".join(begin[:3]) + ",\r\n\t" + ",\t".join(begin[3:]) + "\r\n};")
    head = ["/PROG  PART", "/ATTR", f"LINE_COUNT\t= {len(lines)};", "/MN"]
    numbered = [f"{number:4}:{own} ;" for number, own in enumerate(lines, 1)]
    return {"part.ls": "\r\n".join([*head, *numbered, "/POS", *listed, "/END", ""])}


def read_fanuc(files):
    statements, positions = files["part.ls"].split("/POS")
    known = {}
    for number, text in re.findall(rf"P\[(\d+)(?::\"{OWN}\")?\]\{{(.*?)\}};", positions, re.S):
        values = {name: float(value) for name, value in re.findall(r"\b(J\d|[XYZWPR])\s*=\s*(-?[\d.]+)", text)}
        if "J1" in values:
            known[number] = SIGNS @ np.radians([values[f"J{joint}"] for joint in range(1, 7)]) + ZEROS
        else:
            known[number] = pose(abc([values["R"], values["P"], values["W"]]), [values[axis] for axis in "XYZ"])
    motions, further = [], []
    numbered = re.findall(r"^\s*(\d+):", statements, re.M)
    assert [int(own) for own in numbered] == list(range(1, len(numbered) + 1)), "statements are not numbered one after the other"
    assert len(numbered) == int(re.search(r"LINE_COUNT\s*= (\d+);", statements)[1]), "LINE_COUNT is another"
    for word, rest in re.findall(r"^\s*\d+:([JLC]) (.*?) FINE", statements, re.M | re.S):
        given = further + [known[number] for number in re.findall(rf"P\[(\d+)(?::{OWN})?\]", rest)]
        further = given if OWN in rest else []
        way = {"J": "by joints", "L": "straight", "C": "circle"}[word]
        if not further:
            motions.append(("joints" if given[0].ndim == 1 else way, given))
    return None, pose(np.eye(3), cell.TOOL), motions


UR_SIGNS = np.array([1, 1, 1, 1, 1, -1])  # its last joint turns about the flange's z
UR_LINKS = {"shoulder": "shoulder_pan", "upper_arm": "shoulder_lift", "forearm": "elbow", "wrist_1": "wrist_1", "wrist_2": "wrist_2", "wrist_3": "wrist_3"}


def ur_robot(folder):
    """The same arm as a calibration file of a controller of Universal Robots: each joint's frame in the one before, z along its axis."""
    lines, before = ["kinematics:"], np.eye(4)
    for place, link in enumerate(UR_LINKS):
        z = cell.AXES[place]
        x = np.array([1, 0, 0] if place < 3 else [0, 0, 1])
        own = pose(np.stack([x, np.cross(z, x), z], axis=1), cell.POINTS[place])
        if link == "wrist_3":
            # No calibration has the round angles of a drawing: a microradian about the line to the tool leaves the tool's place as it is.
            own = pose(cell.FLANGE_TURN @ cell.turn(cell.TOOL / np.linalg.norm(cell.TOOL), 1e-6), cell.FLANGE)
        step = inverse(before) @ own
        yaw, pitch, roll = np.radians(as_abc(step[:3, :3]))
        numbers = dict(zip(["x", "y", "z", "roll", "pitch", "yaw"], [*(step[:3, 3] / 1e3), roll, pitch, yaw]))
        lines += [f"  {link}:", *(f"    {name}: {float(value)!r}" for name, value in numbers.items())]
        before = own
    (folder / "ur_calibration.yaml").write_text("\n".join([*lines, "  hash: calib_1", ""]))
    return folder / "ur_calibration.yaml"


def ur_pose(own):
    vector = cell.rotation_vector(own[None, :3, :3])[0]
    return f"p[{', '.join(f'{value:.7f}' for value in (*(own[:3, 3] / 1e3), *vector))}]"


def write_ur_poses(poses, base, start):
    begin = ", ".join(f"{angle:.7f}" for angle in UR_SIGNS * start)
    lines = ["def Part():", f"  global Plane_1={ur_pose(base)}", f"  set_tcp({ur_pose(pose(np.eye(3), cell.TOOL))})", f"  movej([{begin}])"]
    for way, which in WAYS:
        word = {"by joints": "movej", "straight": "movel", "circle": "movec"}[way]
        lines.append(f"  {word}({', '.join(f'pose_trans(Plane_1, {ur_pose(poses[own])})' for own in which)}, a=1.2, v=0.25)")
    return {"part.script": "\n".join([*lines, "end", ""])}


def read_ur_poses(files):
    text = re.sub(r"#.*", "", files["part.script"].replace(f"# {ADDED}", OWN))

    def of(values):
        angle = np.linalg.norm(values[3:])
        turned = cell.turn(np.array(values[3:]) / angle, angle) if angle > 1e-12 else np.eye(3)
        return pose(turned, 1e3 * np.array(values[:3]))

    (base,), (tool,) = (re.findall(pattern, text) for pattern in (r"Plane_1=p\[(.*?)\]", r"set_tcp\(p\[(.*?)\]"))
    motions, further = [], []
    for word, rest, own in re.findall(rf"(move[jlc])\((.*)\)(?: ({OWN}))?", text):
        given = further + [of(numbers(own)) for own in re.findall(r"p\[(.*?)\]", rest)]
        further = given if own else []
        way = {"movej": "by joints", "movel": "straight", "movec": "circle"}[word]
        if not further:
            motions.append((way, given) if given else ("joints", [UR_SIGNS * numbers(re.search(r"\[(.*?)\]", rest)[1])]))
    return of(numbers(base)), of(numbers(tool)), motions


DIALECTS = {
    "KRL": (write_krl, read_krl, "BASE_DATA[1]", "TOOL_DATA[1]"),
    "RAPID": (write_rapid, read_rapid, "wPart.uframe", "tTip"),
    "URScript": (write_urscript, read_urscript, "base", "tcp"),
    "FANUC": (write_fanuc, read_fanuc, "UFRAME[1]", "UTOOL[1]"),
    "URScript poses": (write_ur_poses, read_ur_poses, "Plane_1", "tcp"),
}

# Motions that get further points.
FURTHER = {"KRL": ["LIN", "CIRC"], "RAPID": ["MOVEL", "MOVEC"], "FANUC": ["L", "C"], "URScript poses": ["MOVEL", "MOVEC"]}

# Controllers that count and name the joints of the arm in their own way: with the robot file of that.
COUNTED = {
    "FANUC": (as_fanuc, cell.JOINTS, fanuc_robot),
    "URScript poses": (lambda joints: UR_SIGNS * joints, [f"{name}_joint" for name in UR_LINKS.values()], ur_robot),
}


def touch(arm, part, dialect):
    """The base of three points that the arm really touches: its numbers at the controller, and each point in the file of the cell: of KRL
    and FANUC by the joints that the pendant shows, of RAPID by the pose."""
    is_rapid, shown = dialect == "RAPID", COUNTED.get(dialect, (np.array,))[0]
    ends = [[40, 0, 0], [260, 0, 0], [0, 240, 0]] if is_rapid else [[0, 0, 0], [260, 0, 0], [30, 240, 0]]
    turned = cell.quaternion_turn(cell.ORIENTATION)
    joints = [reach(arm, pose(turned, (part @ [*end, 1])[:3]), START) for end in ends]
    one, two, three = (tool_pose(nominal(), own)[:3, 3] for own in joints)
    x = (two - one) / np.linalg.norm(two - one)
    z = np.cross(x, three - one)
    z /= np.linalg.norm(z)
    # ABB's y-axis goes through the third point.
    origin = one + x * (x @ (three - one)) if is_rapid else one
    written = [stated_pose(own) if is_rapid else f"{{ joints_deg = {[float(q) for q in np.round(np.degrees(shown(own)), 3)]} }}" for own in joints]
    return pose(np.stack([x, np.cross(z, x), z], axis=1), origin), written


def stated_pose(joints):
    shown = tool_pose(nominal(), joints)
    w, x, y, z = as_quaternion(shown[:3, :3])
    place = ", ".join(f"{mm:.2f}" for mm in shown[:3, 3])
    quarters = ", ".join(str(int(np.floor(np.degrees(joints[joint]) / 90))) for joint in (0, 3, 5))
    return f"{{ pose = {{ xyz_mm = [{place}], quaternion_xyzw = [{x:.8f}, {y:.8f}, {z:.8f}, {w:.8f}] }}, cf = [{quarters}, 0] }}"


def frame_place(own):
    w, x, y, z = (float(part) for part in as_quaternion(own[:3, :3]))
    return f"{{ xyz_mm = {[float(mm) for mm in own[:3, 3]]}, quaternion_xyzw = {[x, y, z, w]} }}"


def cell_file(dialect, calibration, points, own_base):
    """What no file of the program states of its frames has its place."""
    _, _, base, tool = DIALECTS[dialect]
    tip = frame_place(pose(np.eye(3), cell.TOOL))
    places = {"URScript": {base: np.eye(4)}, "RAPID": {"base_frame": np.eye(4)}, "URScript poses": {"base": np.eye(4)}}
    places["FANUC"] = {"base_frame": inverse(WORLD), base: inverse(WORLD) @ own_base, tool: pose(np.eye(3), cell.TOOL)}
    places = places.get(dialect, {})
    lines = []
    for name in dict.fromkeys([*places, tool, base]):
        lines += [f'[frames."{name}"]', *([f"place = {frame_place(places[name])}"] if name in places else [])]
        if name == base and points is not None:
            lines += [f'taught_with = "{calibration}"', f"tool = {tip}", f"points = [{', '.join(points)}]"]
        else:
            lines.append('found = "surveyed"')
    return "\n".join(lines) + "\n"


def corrected(binary, folder, dialect, files, calibration, touched, base, name, more=()):
    """The files of the program as posegrid corrects them, and what it says."""
    given = folder / f"{name}-given"
    given.mkdir(parents=True)
    for own, text in files.items():
        (given / own).write_bytes(text.encode())
    (folder / f"{name}.toml").write_text(cell_file(dialect, calibration, touched, base))
    arguments = [binary, "compensate", calibration, given, "--cell", folder / f"{name}.toml", "--points", "off-line", "--no-record"]
    arguments += ["--out", folder / name, *(word for own in ALLOW for word in ("--allow", own)), *more]
    said = cell.command(arguments, {0})
    changed = {own.name: own.read_bytes().decode() for own in (folder / name).iterdir() if own.name in files}
    return {**files, **changed}, said


def loop(binary, folder, seed, options):
    """One arm: measured, identified, and its programs run. Of each dialect and base the distances from the path before and after, which of the
    latter are within the bound, and the distances with a touched base taken as surveyed."""
    generator = np.random.default_rng(seed)
    arm, session = cell.Arm(generator), f"arm-{seed}"
    cell.record(arm, generator, folder / "recordings" / session, options.pitch)
    calibration, bound = identified(binary, folder, session, None)
    own, done = {}, {}
    for dialect, (counted, names, robot) in COUNTED.items():
        other = f"{session}-{dialect.split()[0].lower()}"
        cell.record(arm, np.random.default_rng([seed, 2]), folder / "recordings" / other, options.pitch, counted, names)
        own[dialect] = identified(binary, folder, other, robot(folder))
    for number in range(PARTS):
        name = f"{session}-{number}"
        for key, part in corrected_part(binary, folder, arm, generator, own, (calibration, bound), name, options).items():
            done.setdefault(key, []).append(part)
    found = {}
    for key, parts in done.items():
        before, after, is_within, surveyed = found[key] = [np.concatenate(part) for part in zip(*parts)]
        extra = "" if not len(surveyed) else f", taken as surveyed {surveyed.mean():.3f}"
        within = f"{100 * is_within.mean():.1f} % within {own.get(key[0], (calibration, bound))[1]:.3f}"
        print(f"| {seed} | {key[0]} | {key[1]} | {before.mean():.3f} | {after.mean():.3f}{extra} | {within} |", flush=True)
    return found


def identified(binary, folder, session, robot):
    """The calibration of a session, and the bound that its run promises of poses, mm."""
    cell.command([binary, "run", cell.pipeline(folder, session, [], robot=robot)], {0, 3})
    (calibration,) = (folder / "lake/calibrations").glob(f"*/{session}/*.parquet")
    (bound,) = duckdb.sql(
        f"SELECT value FROM read_parquet('{folder}/lake/accuracy/*/{session}/*.parquet') WHERE split = 'blocks' AND model = 'full' "
        "AND angles = 'commanded' AND base_refit = 'none' AND moment = 'after' AND name = 'bound'"
    ).fetchall()[0]
    return calibration, bound


def corrected_part(binary, folder, arm, generator, own_arms, of_others, name, options):
    """Programs over a part: of each dialect and base the distances from the path before and after, which of the latter are within the bound and
    what the report states between positions, and the distances with a touched base taken as surveyed."""
    turned = cell.euler([generator.uniform(-3, 3), generator.uniform(-3, 3), generator.uniform(-40, 40)])
    part = pose(turned, cell.LOW + cell.SIZE * generator.uniform([0.35, 0.3, 0.2], [0.6, 0.6, 0.8]))
    poses = points(generator, part)
    done = {}
    for dialect, (write, read, *_) in DIALECTS.items():
        calibration, bound = own_arms.get(dialect, of_others)
        touched, points_touched = touch(arm, part, dialect)
        # Joint angles stand in no base.
        ways = (("surveyed", part, None), ("taught", touched, points_touched))[: 1 if dialect == "URScript" else 2]
        for how, base, taught in ways:
            files = write(poses, base, START)
            own_base, tool, motions = read(files)
            own_base = base if own_base is None else own_base
            assert np.allclose(tool[:3, 3], cell.TOOL)
            # What the program means: the nominal arm with the base on the part.
            meant = nominal().tool_pose(run(motions, part))[1]
            # The parts of the first dialects stand where they stood without the others.
            noise = generator if dialect in ("KRL", "RAPID") else np.random.default_rng(7)
            off = lambda motions: np.linalg.norm(driven(arm, noise, motions, own_base) - meant, axis=1)[PLACES:]

            def after(taught, name, *more):
                text, said = corrected(binary, folder, dialect, files, calibration, taught, base, name, more)
                if options.verbose:
                    print(said)
                base_after, _, motions_after = read(text)
                assert base_after is None or np.array_equal(base_after, own_base), "the numbers of a frame changed"
                between = float(re.search(r"leaves the wanted path by ([\d.]+) mm at most", said)[1])
                further = re.findall(rf"(\w+)[ (].*(?:{ADDED}|:{OWN}\])", "\n".join(text.values()))
                return off(motions_after), between, {own.upper() for own in further}

            own = f"{name}-{dialect}-{how}"
            before, (left, between, _) = off(motions), after(taught, own)
            surveyed = np.array([]) if taught is None else after(None, f"{own}-as-surveyed")[0]
            done[dialect, how] = before, left, left <= bound + between, surveyed
            if taught is None and dialect != "URScript":
                dense, between, added = after(None, f"{own}-dense", "--densify", DENSIFY_MM)
                options.added |= {f"{dialect} {own}" for own in added}
                done[dialect, "densified"] = before, dense, dense <= bound + between, surveyed
    return done


def driven(arm, generator, motions, base):
    """Places of the tool where the wrong arm is sent along the motions."""
    joints = run(motions, base)
    return arm.tool_pose(joints + generator.normal(0, cell.REPEATABILITY, joints.shape))[1]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binary", type=pathlib.Path, help="posegrid")
    parser.add_argument("--seed", type=int, action="append", help="an arm; may be given several times")
    parser.add_argument("--folder", type=pathlib.Path, default=ROOT / "target/programs", help="a new folder to work in")
    parser.add_argument("--pitch", type=float, default=120.0, help="pitch of the measured stations, mm")
    parser.add_argument("--verbose", action="store_true", help="print what each correction says")
    options = parser.parse_args()
    options.added = set()  # motions that got further points
    folder = options.folder.resolve()
    folder.mkdir(parents=True)
    print("mean distance from the path on the part, mm")
    print("| seed | dialect | base | before | after | along the path |")
    seeds = options.seed or [1]
    done = [loop(options.binary.resolve(), folder, seed, options) for seed in seeds]
    missing = {f"{dialect} {word}" for dialect, words in FURTHER.items() for word in words} - options.added
    wrong = [f"no further points of {', '.join(sorted(missing))}"] if missing else []
    for key in done[0]:
        within = np.concatenate([own[key][2] for own in done]).mean()
        print(f"{' '.join(key)}: {100 * within:.1f} % of the places along the paths of {len(seeds)} arms within their bounds")
        if within < 0.95:
            wrong.append(f"{' '.join(key)}: {100 * within:.1f} % of the places are within their bounds, asked 95 %")
        for seed, own in zip(seeds, done):
            before, after, _, surveyed = own[key]
            if after.mean() > before.mean() or (len(surveyed) and after.mean() > surveyed.mean()):
                wrong.append(f"seed {seed}, {' '.join(key)}: {after.mean():.3f} mm after, {before.mean():.3f} mm before")
    for problem in wrong:
        print(problem, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
