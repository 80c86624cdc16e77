"""The files of engines that read them themselves, checked by what their own packages know of them.

    python tests/readers/engine_files.py                             # needs kubernetes-validate, hera and pyyaml, from PyPI
    python tests/readers/engine_files.py --airflow target/airflow    # needs apache-airflow: loads the DAG, and runs it once

Kubernetes' own schema judges `kubernetes.yaml`, the models that hera has of Argo's API judge `argo.yaml`: each as it is, and once more with
a mistake that has to be found. `argo lint` itself is not to be had as a package, and is not run.
"""

import argparse
import copy
import os
import pathlib
import subprocess
import sys

FLEET = pathlib.Path(__file__).resolve().parents[2] / "pipelines/fleet"


def loaded(name):
    import yaml

    return yaml.safe_load((FLEET / name).read_text())


def is_refused(check, document, path, value):
    """Asserts that a document passes, and that it does not with a value put at a path of keys."""
    check(document)
    wrong = copy.deepcopy(document)
    within = wrong
    for key in path[:-1]:
        within = within[key]
    within[path[-1]] = value
    try:
        check(wrong)
    except Exception as error:
        return str(error).split("\n")[0]
    raise AssertionError(f"{path} = {value} was not found")


def differing(read, written, path=""):
    """The paths at which two documents differ."""
    if isinstance(read, dict) and isinstance(written, dict):
        own = (differing(read.get(key), written.get(key), f"{path}.{key}") for key in read.keys() | written.keys())
        return [place for places in own for place in places]
    if isinstance(read, list) and isinstance(written, list) and len(read) == len(written):
        return [place for pair in enumerate(zip(read, written)) for place in differing(*pair[1], f"{path}[{pair[0]}]")]
    return [] if read == written else [f"{path}: {written!r}"]


def kubernetes():
    import kubernetes_validate

    job = loaded("kubernetes.yaml")
    version = kubernetes_validate.latest_version()
    found = is_refused(lambda own: kubernetes_validate.validate(own, version, strict=True), job, ["spec", "completion"], 3)
    print(f"kubernetes.yaml is a job of Kubernetes {version}; a wrong key is found: {found}")


def argo():
    from hera.workflows.models import Workflow

    def check(document):
        # The models leave out what they do not know: then the document is not what it was.
        read = Workflow.model_validate(document).model_dump(by_alias=True, exclude_none=True, mode="json")
        assert read == document, f"not all of it is known: {differing(read, document)}"

    found = is_refused(check, loaded("argo.yaml"), ["spec", "templates", 2, "retryStrategy", "limits"], "6")
    print(f"argo.yaml is a workflow of Argo by hera's models; a wrong key is found: {found}")
    templates = {own["name"]: own for own in loaded("argo.yaml")["spec"]["templates"]}
    steps = [step["template"] for group in templates["fleet"]["steps"] for step in group]
    assert set(steps) == set(templates) - {"fleet"}, steps
    print("SKIPPED: argo lint, which no package has; its names of templates were checked here")


def airflow(folder, pipeline, posegrid):
    """Loads the DAG, and runs it once where there is a pipeline file."""
    folder = folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    os.environ |= {"AIRFLOW_HOME": str(folder), "AIRFLOW__CORE__LOAD_EXAMPLES": "False", "AIRFLOW__CORE__DAGS_FOLDER": str(FLEET)}
    os.environ |= {"POSEGRID_PIPELINE": str(pipeline), "POSEGRID": str(posegrid), "PYTHONPATH": str(FLEET)}
    program = pathlib.Path(sys.executable).with_name("airflow")
    subprocess.run([program, "db", "migrate"], check=True, stdout=subprocess.DEVNULL)
    parsed = "import on_airflow; own = on_airflow.posegrid_fleet(); print(sorted(own.task_ids)); own.validate()"
    subprocess.run([sys.executable, "-c", parsed], check=True)
    if pipeline:
        subprocess.run([program, "dags", "reserialize"], check=True, stdout=subprocess.DEVNULL)
        ended = subprocess.run([program, "dags", "test", "posegrid_fleet"], check=False)
        print(f"airflow dags test ended with {ended.returncode}")


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--airflow", type=pathlib.Path, help="the folder of Airflow's own files")
    arguments.add_argument("--pipeline", type=pathlib.Path, help="a pipeline file that the DAG works off once")
    arguments.add_argument("--posegrid", type=pathlib.Path, default="posegrid")
    given = arguments.parse_args()
    if given.airflow:
        airflow(given.airflow, given.pipeline and given.pipeline.resolve(), given.posegrid)
    else:
        kubernetes()
        argo()


if __name__ == "__main__":
    main()
