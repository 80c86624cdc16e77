"""The run asked for last is the current one, as DuckDB sees it by the views of posegrid.

    python tests/readers/current_runs.py POSEGRID

The quickstart is run with a tolerance of 0.1 mm (not met), 0.5 mm (met) and 0.1 mm again. Checked after each: the view sessions of `posegrid
schema views`, of `posegrid schema views --compact`, and with its last lines for what is newer than the state, give the run that
was asked for last; and asked gives which run was believed between the requests. Without the folder asked, as earlier versions leave a lake,
the run counts that no other replaces.
"""

import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

from read_compact import connected, views

HERE = pathlib.Path(__file__).resolve().parents[2]
BELIEVED = "SELECT arg_max(run, number) FROM asked WHERE asked_at <= (SELECT asked_at FROM asked WHERE number = {})"


def answers(posegrid, lake):
    """What each kind of view says of the only session: run and verdict."""
    rows = "SELECT run, verdict FROM sessions"
    kinds = {"plain": views(posegrid), "by month": views(posegrid, "--compact"), "with newer": views(posegrid, "--compact").replace("--+ ", "")}
    return {kind: connected(sql, lake).execute(rows).fetchall() for kind, sql in kinds.items()}


def main():
    posegrid = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as folder:
        lake, pipeline = pathlib.Path(folder) / "lake", pathlib.Path(folder) / "pipelines/quickstart.toml"
        shutil.copytree(HERE / "pipelines/robots", pipeline.parent / "robots")
        shutil.copytree(HERE / "tests/recordings/quickstart", pathlib.Path(folder) / "tests/recordings/quickstart")
        text = (HERE / "pipelines/quickstart.toml").read_text()
        asked = []
        for tolerance, verdict in (("0.1", "not_met"), ("0.5", "met"), ("0.1", "not_met")):
            pipeline.write_text(re.sub(r"^mm = 0.5", f"mm = {tolerance}", text, flags=re.MULTILINE))
            subprocess.run([posegrid, "run", pipeline], stdout=subprocess.DEVNULL, check=False)
            if not asked:
                subprocess.run([posegrid, "compact", lake], stdout=subprocess.DEVNULL, check=True)
            found = answers(posegrid, lake)
            asked.append(found["plain"][0][0])
            assert found["plain"] == found["with newer"] == [(asked[-1], verdict)], found
            subprocess.run([posegrid, "compact", lake], stdout=subprocess.DEVNULL, check=True)
            found = answers(posegrid, lake)
            assert set(map(tuple, found.values())) == {((asked[-1], verdict),)}, found
        assert asked[0] == asked[2] != asked[1], asked
        connection = connected(views(posegrid), lake)
        believed = [connection.execute(BELIEVED.format(number)).fetchone()[0] for number in (1, 2, 3)]
        assert believed == asked, (believed, asked)
        for earlier in ("asked", "compact"):
            shutil.rmtree(lake / earlier)
        subprocess.run([posegrid, "compact", lake], stdout=subprocess.DEVNULL, check=True)
        found = answers(posegrid, lake)
        assert set(map(tuple, found.values())) == {((asked[1], "met"),)}, found
    print(f"runs asked for, and believed in turn by DuckDB: {', '.join(asked)}; without requests {asked[1]}")


if __name__ == "__main__":
    main()
