"""Lakes of a proof, in a folder or on an S3 server: their files, and how many runs they have."""

import os
import pathlib
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parents[2]
BUCKET = "bucket"


def is_published(name):
    """Whether a file of that name follows from the work: temporaries, the index and `asked`, which has a clock, do not."""
    return not name.startswith((".", "asked/")) and "/." not in name


class InFolder:
    """A lake in a folder."""

    def __init__(self, path):
        self.place = str(path)
        self.path = path

    def files(self):
        """Every published file, by its name in the lake."""
        paths = (path for path in self.path.rglob("*") if path.is_file())
        named = ((path.relative_to(self.path).as_posix(), path) for path in paths)
        return {name: path.read_bytes() for name, path in named if is_published(name)}

    def count(self):
        """Number of runs."""
        return sum(1 for path in self.path.glob("runs/*/*/*.parquet") if is_published(path.name))


class OnServer:
    """A lake on an S3 server."""

    def __init__(self, server, name):
        self.server, self.name = server, name
        self.place = f"s3://{BUCKET}/{name}"

    def keys(self, below):
        pages = self.server.client.get_paginator("list_objects_v2").paginate(Bucket=BUCKET, Prefix=f"{self.name}/{below}")
        return [found["Key"].removeprefix(f"{self.name}/") for page in pages for found in page.get("Contents", [])]

    def files(self):
        def content(key):
            return self.server.client.get_object(Bucket=BUCKET, Key=f"{self.name}/{key}")["Body"].read()

        return {key: content(key) for key in self.keys("") if is_published(key)}

    def count(self):
        return len(self.keys("runs/"))


class Server:
    """The S3 server of the tests, which this process and those that it starts reach."""

    def __init__(self):
        command = [sys.executable, HERE / "tests/store/server.py", "serve"]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, encoding="utf-8")
        port, key, secret = self.process.stdout.readline().split()
        self.url = f"http://127.0.0.1:{port}"
        os.environ |= {"AWS_ENDPOINT_URL": self.url, "AWS_ALLOW_HTTP": "true", "NO_PROXY": "127.0.0.1"}
        os.environ |= {"AWS_ACCESS_KEY_ID": key, "AWS_SECRET_ACCESS_KEY": secret, "AWS_REGION": "us-east-1"}
        import boto3

        self.client = boto3.client("s3", region_name="us-east-1")

    def upload(self, folder, name):
        """Puts the files of a folder below a name; returns the address."""
        for path in sorted(path for path in folder.rglob("*") if path.is_file()):
            key = f"{name}/{path.relative_to(folder).as_posix()}"
            self.client.put_object(Bucket=BUCKET, Key=key, Body=path.read_bytes())
        return f"s3://{BUCKET}/{name}"
