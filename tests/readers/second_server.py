"""A lake on an S3 server that shares nothing with that of the tests: `s3s-fs`, from crates.io.

    cargo install s3s-fs --features binary --root target/s3s
    python tests/readers/second_server.py target/release/posegrid target/s3s/bin/s3s-fs --folder target/second-server

The quickstart's session is run into a folder, and onto the server by two processes at once: the same files, byte for byte, whichever of the
two wrote them, and the session committed once. Then it is known without reading it, verified, compacted and judged by `history`, whose pages
are those of the folder.
"""

import argparse
import os
import pathlib
import re
import shutil
import socket
import subprocess
import time

import boto3
import botocore.exceptions

import lakes

HERE = pathlib.Path(__file__).resolve().parents[2]
KEY, SECRET = "AKIAOFASECONDSERVER", "never-to-be-told"


class Second:
    """The server, with one bucket."""

    def __init__(self, binary, root):
        (root / lakes.BUCKET).mkdir(parents=True)
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        command = [binary, "--host", "127.0.0.1", "--port", str(port), "--access-key", KEY, "--secret-key", SECRET, root]
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.environ |= {"AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}", "AWS_ALLOW_HTTP": "true", "NO_PROXY": "127.0.0.1"}
        os.environ |= {"AWS_ACCESS_KEY_ID": KEY, "AWS_SECRET_ACCESS_KEY": SECRET, "AWS_REGION": "us-east-1"}
        self.client = boto3.client("s3", region_name="us-east-1")
        for _ in range(100):
            try:
                self.client.list_objects_v2(Bucket=lakes.BUCKET)
                return
            except botocore.exceptions.ClientError:
                raise
            except botocore.exceptions.BotoCoreError:
                time.sleep(0.1)
        raise SystemExit("the server does not answer")


def pipeline(folder, lake):
    """The quickstart with its lake there."""
    text = (HERE / "pipelines/quickstart.toml").read_text()
    text = text.replace('"../tests/recordings"', f'"{HERE}/tests/recordings"').replace('"../lake"', f'"{lake}"')
    text = re.sub(r'file = "robots/', f'file = "{HERE}/pipelines/robots/', text)
    # A pipeline's name is part of its runs.
    path = folder / f"to-{lake.rsplit('/', 1)[-1]}" / "quickstart.toml"
    path.parent.mkdir()
    path.write_text(text)
    return path


def ended(command, codes=(0,)):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
    assert done.returncode in codes, f"{command}: {done.returncode}\n{done.stdout}\n{done.stderr}"
    return done.stdout + done.stderr


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("posegrid", type=pathlib.Path)
    arguments.add_argument("server", type=pathlib.Path)
    arguments.add_argument("--folder", type=pathlib.Path, required=True)
    given = arguments.parse_args()
    posegrid, folder = given.posegrid.resolve(), given.folder.resolve()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    second = Second(given.server.resolve(), folder / "server")
    try:
        local = lakes.InFolder(folder / "lake-local")
        remote = lakes.OnServer(second, "lake")
        ended([posegrid, "run", pipeline(folder, local.place)])
        own = pipeline(folder, remote.place)
        both = [subprocess.Popen([posegrid, "run", own], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) for _ in range(2)]
        told = [process.communicate()[0] for process in both]
        codes = [process.returncode for process in both]
        assert codes == [0, 0], f"{codes}\n" + "\n".join(told)
        assert remote.count() == 1, f"{remote.count()} runs"
        here, there = local.files(), remote.files()
        assert here == there, f"files differ: {sorted(set(here) ^ set(there)) or [name for name in here if here[name] != there[name]]}"
        print(f"two processes at once: 1 run, {len(there)} files byte for byte those of a folder")
        known = ended([posegrid, "run", own])
        print("again: " + known.strip().splitlines()[0])
        print("verify: " + ended([posegrid, "verify", remote.place, "--pipeline", own]).strip().splitlines()[-1])
        print("compact: " + ended([posegrid, "compact", remote.place]).strip().splitlines()[0])
        for name, lake in (("local", local), ("remote", remote)):
            ended([posegrid, "history", lake.place, "--output", folder / f"history-{name}"], (0, 3))
        pages = [{path.name: path.read_bytes() for path in (folder / f"history-{name}").iterdir()} for name in ("local", "remote")]
        assert pages[0] == pages[1], "history differs"
        print(f"history: {len(pages[0])} files alike")
    finally:
        second.process.kill()


if __name__ == "__main__":
    main()
