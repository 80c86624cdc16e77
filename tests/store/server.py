"""An S3-compatible server on loopback for the tests: moto, from PyPI (`pip install 'moto[server]' boto3 pyarrow`).

    python tests/store/server.py serve [strict] a server with one bucket, `bucket`; tells `PORT KEY SECRET` and runs until
                                                its standard input is closed
    python tests/store/server.py put URL KEY    puts standard input at a key as it is written, which other clients refuse
    python tests/store/server.py read URL LAKE  reads every table of the lake there with pyarrow: rows by table, as JSON

A strict server refuses any other key as Amazon does. It is not the rule because moto checks signatures wrongly where an
address holds a space or `%`.
"""

import json
import os
import sys

BUCKET = "bucket"
POLICY = {
    "Version": "2012-10-17",
    "Statement": [{"Effect": "Allow", "Action": "*", "Resource": "*"}],
}


def client(service, url, key="test", secret="test"):
    import boto3

    return boto3.client(
        service,
        endpoint_url=url,
        aws_access_key_id=key,
        aws_secret_access_key=secret,
        region_name="us-east-1",
    )


def serve(strict=""):
    from moto.server import ThreadedMotoServer

    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    port = server.get_host_and_port()[1]
    url = f"http://127.0.0.1:{port}"
    client("s3", url).create_bucket(Bucket=BUCKET)
    key, secret = "AKIAOFTHETESTSALONE", "open-to-all-but-never-to-be-told"
    if strict:
        key, secret = one_user(url)
    print(port, key, secret, flush=True)
    sys.stdin.read()
    os._exit(0)


def one_user(url):
    """Lets in one user only, from here on; gives that user's key."""
    import requests

    iam = client("iam", url)
    iam.create_user(UserName="nightly")
    iam.put_user_policy(UserName="nightly", PolicyName="all", PolicyDocument=json.dumps(POLICY))
    key = iam.create_access_key(UserName="nightly")["AccessKey"]
    requests.post(f"{url}/moto-api/reset-auth", data="0", timeout=10)
    return key["AccessKeyId"], key["SecretAccessKey"]


def put(url, key):
    own = client("s3", url, os.environ["AWS_ACCESS_KEY_ID"], os.environ["AWS_SECRET_ACCESS_KEY"])
    own.put_object(Bucket=BUCKET, Key=key, Body=sys.stdin.buffer.read())


def read(url, lake):
    import pyarrow.dataset
    from pyarrow import fs

    files = fs.S3FileSystem(
        access_key=os.environ["AWS_ACCESS_KEY_ID"],
        secret_key=os.environ["AWS_SECRET_ACCESS_KEY"],
        endpoint_override=url,
        scheme="http",
        region="us-east-1",
    )
    rows = {}
    for folder in files.get_file_info(fs.FileSelector(f"{BUCKET}/{lake}")):
        if folder.base_name not in ("report", "compact") and not folder.base_name.startswith("."):
            table = pyarrow.dataset.dataset(folder.path, filesystem=files).to_table()
            rows[folder.base_name] = table.num_rows
    print(json.dumps(rows, sort_keys=True))


if __name__ == "__main__":
    {"serve": serve, "put": put, "read": read}[sys.argv[1]](*sys.argv[2:])
