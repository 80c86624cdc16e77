"""Clusters of two worker processes on this machine, of which a worker is killed or the scheduler is started anew.

What is killed is known by its process: each cluster ends those that it started, and their children, and no others.
"""

import os
import pathlib
import shutil
import socket
import subprocess
import sys
import time


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def killed(process):
    """Kills a process with all that it started."""
    import psutil

    try:
        tree = [*psutil.Process(process.pid).children(recursive=True), psutil.Process(process.pid)]
    except psutil.NoSuchProcess:
        tree = []
    for own in reversed(tree):
        try:
            own.kill()
        except psutil.NoSuchProcess:
            pass
    process.wait()


class Cluster:
    """A scheduler and two workers; an engine says how each is started."""

    # Whether the script that works on it has a scheduler of its own, and is ended with the cluster's.
    ends_script = False

    def __init__(self, folder):
        self.folder, self.port = folder, free_port()
        self.log = (folder / f"{type(self).__name__.lower()}.log").open("ab")
        self.environment = os.environ | {"PYTHONPATH": ""}
        self.scheduler, self.workers = None, []

    def __enter__(self):
        self.scheduler = self.started(self.scheduler_command())
        self.waited()
        self.workers = [self.started(command) for command in self.worker_commands()]
        return self

    def __exit__(self, *_):
        for process in [*self.workers, self.scheduler]:
            killed(process)

    def started(self, command):
        """Starts a process of the cluster; what it says goes to the cluster's log."""
        return subprocess.Popen(command, stdout=self.log, stderr=self.log, stdin=subprocess.DEVNULL, env=self.environment)

    def waited(self):
        """Waits until the scheduler answers."""
        for _ in range(600):
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", self.port)) == 0:
                    return
            time.sleep(0.1)
        raise AssertionError(f"no scheduler answers; see {self.log.name}")

    def loses_a_worker(self):
        """Kills the last worker with its tasks, and starts another."""
        killed(self.workers.pop())
        self.workers.append(self.started(self.worker_commands()[-1]))

    def restarts(self):
        """Kills the scheduler, and starts it anew, with workers."""
        killed(self.scheduler)
        for worker in self.workers:
            killed(worker)
        self.__enter__()


class Dask(Cluster):
    """Dask's scheduler, and two workers of one thread."""

    @property
    def address(self):
        return f"tcp://127.0.0.1:{self.port}"

    def scheduler_command(self):
        return [sys.executable, "-m", "dask", "scheduler", "--host", "127.0.0.1", "--port", str(self.port), "--no-dashboard"]

    def worker_commands(self):
        folder = ["--local-directory", str(self.folder / "dask")]
        return [[sys.executable, "-m", "dask", "worker", self.address, "--nthreads", "1", "--no-dashboard", *folder]] * 2


class Ray(Cluster):
    """A head with one worker process, and another node with one. Head and worker of it are lost together."""

    ends_script = True

    def __init__(self, folder):
        super().__init__(folder)
        self.environment |= {"RAY_DISABLE_IMPORT_WARNING": "1", "RAY_USAGE_STATS_ENABLED": "0"}

    @property
    def address(self):
        return f"127.0.0.1:{self.port}"

    def start(self, *arguments):
        program = pathlib.Path(sys.executable).with_name("ray")
        return [program, "start", *arguments, "--num-cpus", "1", "--object-store-memory", "100000000", "--block"]

    def scheduler_command(self):
        return self.start("--head", "--node-ip-address", "127.0.0.1", "--port", str(self.port), "--include-dashboard", "false")

    def worker_commands(self):
        return [self.start("--address", self.address)]


class Spark(Cluster):
    """A standalone master that keeps its state, and two workers of one core: master alone is started anew, and scripts go on."""

    def __init__(self, folder):
        super().__init__(folder)
        import pyspark

        home = pathlib.Path(pyspark.__file__).parent
        self.spark_class = home / "bin" / "spark-class"
        self.environment |= {"SPARK_HOME": str(home), "PYSPARK_PYTHON": sys.executable, "SPARK_LOCAL_IP": "127.0.0.1"}
        state = folder / "spark-state"
        for kept in (folder / "spark", state):
            shutil.rmtree(kept, ignore_errors=True)
        # Two scripts are two applications: unless each has a share, the second waits until the first has ended.
        recovery = f"-Dspark.deploy.recoveryMode=FILESYSTEM -Dspark.deploy.recoveryDirectory={state}"
        self.environment["SPARK_MASTER_OPTS"] = f"-Dspark.deploy.defaultCores=1 {recovery}"

    def restarts(self):
        """Kills the master, and starts it anew; its workers come back to it."""
        killed(self.scheduler)
        self.scheduler = self.started(self.scheduler_command())
        self.waited()

    @property
    def address(self):
        return f"spark://127.0.0.1:{self.port}"

    def scheduler_command(self):
        where = ["--host", "127.0.0.1", "--port", str(self.port), "--webui-port", "0"]
        return [self.spark_class, "org.apache.spark.deploy.master.Master", *where]

    def worker_commands(self):
        size = ["--cores", "1", "--memory", "1500m", "--webui-port", "0", "--work-dir", str(self.folder / "spark")]
        return [[self.spark_class, "org.apache.spark.deploy.worker.Worker", *size, self.address]] * 2


CLUSTERS = {"dask": Dask, "ray": Ray, "spark": Spark}
