"""posegrid as each way of installing it gives it, in a clean environment: the main job, and the same bytes from all on one system.

    python tests/readers/installed.py --folder target/installed [--only cargo --only wheel --only deb --only container --only windows]

Each way builds what it distributes, installs it where nothing of the checkout is, and does the main job there: cargo's in a folder of its
own, the wheel in a new Python environment, the Debian package in a new system (debootstrap), the image in a container, the program for
Windows under Wine, whose sines round otherwise: what `run` tells must be the same there, and `verify` must find the bytes again. What this machine cannot do is told as a skip, with the reason; `--no-skips` makes one a failure.
"""

import argparse
import os
import pathlib
import shutil
import subprocess
import sys
import venv

HERE = pathlib.Path(__file__).resolve().parents[2]
WINDOWS = "x86_64-pc-windows-gnu"
# Megabytes: what is distributed stays small enough to be copied to every worker.
LARGEST_IMAGE_MB = 60
# The name, among the published files, of what `run` told.
TOLD = "what run told"
# Wine before 8.13 has no bcryptprimitives.dll, which Rust's standard library asks for random numbers; Windows has had it since 7.
RANDOM_NUMBERS = """
#include <windows.h>
BOOLEAN NTAPI SystemFunction036(PVOID, ULONG);
__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE data, SIZE_T size) { return SystemFunction036(data, (ULONG)size); }
"""


class Skip(Exception):
    """This machine cannot do it."""


def done(*command, **options):
    """What a command writes to stdout; all its output is told where it fails."""
    ended = subprocess.run(command, capture_output=True, encoding="utf-8", errors="replace", check=False, **options)
    if ended.returncode:
        sys.exit(f"{' '.join(map(str, command))} ended with {ended.returncode}:\n{ended.stdout[-4000:]}\n{ended.stderr[-4000:]}")
    return ended.stdout


def needs(program, advice):
    """The path of a program, or a skip."""
    found = shutil.which(program)
    if not found:
        raise Skip(f"there is no {program}; {advice}")
    return found


def as_root():
    """Whether commands that change a system may be used."""
    if os.geteuid():
        raise Skip("it takes root, for a new system of its own")


def cell(folder):
    """A folder with what the main job reads, and nothing else of the checkout."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(HERE / "pipelines", folder / "pipelines")
    shutil.copytree(HERE / "tests/recordings/quickstart", folder / "tests/recordings/quickstart")
    return folder


def job(command, folder, **options):
    """Does the main job in a clean folder and verifies its lake; returns the published files."""
    environment = {"PATH": "/usr/bin:/bin", "HOME": str(folder), "LANG": "C.UTF-8"} | options.pop("environment", {})
    told = done(*command, "run", "pipelines/quickstart.toml", cwd=folder, env=environment)
    done(*command, "verify", "lake", "--pipeline", "pipelines/quickstart.toml", cwd=folder, env=environment)
    return files(folder / "lake", told)


def files(lake, told):
    """Every published file of a lake, by its path there, and what `run` told."""
    paths = ((path.relative_to(lake).as_posix(), path) for path in lake.rglob("*") if path.is_file())
    return {TOLD: told.replace("\\", "/")} | {name: path.read_bytes() for name, path in paths if not name.startswith(".")}


def megabytes(path):
    return path.stat().st_size / 1e6


def by_cargo(folder):
    """`cargo install`, as the README has it."""
    done("cargo", "install", "--path", HERE, "--locked", "--root", folder / "root", "--target-dir", folder.parent / "build", cwd=HERE)
    program = folder / "root/bin/posegrid"
    return job([program], cell(folder / "cell")), f"program {megabytes(program):.1f} MB"


def shared(build):
    """What wheel and package hold beside the program, in the folder that the guide names."""
    share = HERE / "posegrid.data/data/share"
    places = {"bash": "bash-completion/completions/posegrid", "zsh": "zsh/site-functions/_posegrid", "fish": "fish/vendor_completions.d/posegrid.fish"}
    for shell, place in places.items():
        script = done("cargo", "run", "--release", "--locked", "--", "completions", shell, cwd=HERE, env=build)
        (share / place).parent.mkdir(parents=True, exist_ok=True)
        (share / place).write_text(script, encoding="utf-8")
    done("cargo", "run", "--release", "--locked", "--", "man", share / "man/man1", cwd=HERE, env=build)
    for own in ("pipelines", "schemas"):
        shutil.copytree(HERE / own, share / "posegrid" / own, dirs_exist_ok=True)


def by_wheel(folder):
    """A wheel of the program, in a new Python environment without an index."""
    tools = folder.parent / "tools"
    venv.create(tools, with_pip=True)
    done(tools / "bin/pip", "install", "-q", "maturin")
    wheels = folder / "wheels"
    shared(os.environ | {"CARGO_TARGET_DIR": str(folder.parent / "build")})
    done(
        tools / "bin/maturin", "build", "--profile", "dist", "--locked", "--bindings", "bin", "--features", "s3",
        "--out", wheels, "--target-dir", folder.parent / "build", "--manifest-path", HERE / "Cargo.toml", cwd=HERE,
    )  # fmt: skip
    [wheel] = wheels.glob("*.whl")
    venv.create(folder / "env", with_pip=True)
    done(folder / "env/bin/pip", "install", "-q", "--no-index", wheel)
    for own in ("man/man1/posegrid.1", "posegrid/schemas/json/pipeline.json", "bash-completion/completions/posegrid"):
        assert (folder / "env/share" / own).is_file(), own
    return job([folder / "env/bin/posegrid"], cell(folder / "cell")), f"{wheel.name} {megabytes(wheel):.1f} MB"


def by_deb(folder):
    """The package, in a new Debian that has nothing else."""
    as_root()
    needs("dpkg-deb", "it is Debian's")
    debootstrap = needs("debootstrap", "apt-get install debootstrap")
    tools = folder.parent / "tools"
    done("cargo", "install", "cargo-deb", "--locked", "--root", tools, "--target-dir", folder.parent / "build-tools")
    build = os.environ | {"CARGO_TARGET_DIR": str(folder.parent / "build")}
    shared(build)
    package = folder / "posegrid.deb"
    done(tools / "bin/cargo-deb", "--locked", "--output", package, cwd=HERE, env=build)
    release = done("sh", "-c", ". /etc/os-release && echo $VERSION_CODENAME").strip()
    root = folder / "root"
    shutil.rmtree(root, ignore_errors=True)
    done(debootstrap, "--variant=minbase", release, root)
    shutil.copy(package, root / "posegrid.deb")
    done("chroot", root, "dpkg", "--install", "/posegrid.deb")
    done("chroot", root, "sh", "-c", "posegrid --version && cd /usr/share/doc/posegrid && ls examples/quickstart.toml LICENSE-MIT LICENSE-APACHE")
    cell(root / "cell")
    # Another root, so the working folder is named inside it.
    inside = ("chroot", root, "sh", "-c", 'cd /cell && exec posegrid "$@"', "sh")
    told = done(*inside, "run", "pipelines/quickstart.toml")
    done(*inside, "verify", "lake", "--pipeline", "pipelines/quickstart.toml")
    done("chroot", root, "dpkg", "--purge", "posegrid")
    assert not (root / "usr/bin/posegrid").exists(), "the package leaves its program behind"
    return files(root / "cell/lake", told), f"package {megabytes(package):.1f} MB"


def by_container(folder):
    """The image, by whichever of the two programs works here."""
    engines = [name for name in ("podman", "docker") if shutil.which(name)]
    works = [name for name in engines if subprocess.run([name, "info"], capture_output=True, check=False).returncode == 0]
    if not works:
        raise Skip("neither podman nor docker works here")
    engine = works[0]
    base = subprocess.run([engine, "pull", "debian:bookworm-slim"], capture_output=True, encoding="utf-8", check=False)
    if base.returncode:
        raise Skip(f"there is no base image: {base.stderr.strip().splitlines()[-1]}")
    done(engine, "build", "-f", HERE / "pipelines/fleet/Containerfile", "-t", "posegrid-proof", HERE)
    saved = folder / "image.tar"
    done(engine, "save", "-o", saved, "posegrid-proof")
    done("gzip", "--force", saved)
    size = megabytes(saved.with_suffix(".tar.gz"))
    assert size <= LARGEST_IMAGE_MB, f"the image takes {size:.1f} MB"
    at = cell(folder / "cell")
    return job([engine, "run", "--rm", "-v", f"{at}:/cell", "-w", "/cell", "posegrid-proof"], at), f"image {size:.1f} MB as it is sent"


def by_windows(folder):
    """The program for Windows, under Wine."""
    needs("x86_64-w64-mingw32-gcc", "apt-get install gcc-mingw-w64-x86-64")
    if WINDOWS not in done("rustup", "target", "list", "--installed"):
        raise Skip(f"there is no standard library for it; rustup target add {WINDOWS}")
    done("cargo", "build", "--profile", "dist", "--locked", "--target", WINDOWS, "--target-dir", folder.parent / "build", cwd=HERE)
    program = folder.parent / "build" / WINDOWS / "dist/posegrid.exe"
    wine = shutil.which("wine64") or shutil.which("wine") or "/usr/lib/wine/wine64"
    if not pathlib.Path(wine).exists():
        raise Skip("it is built, but there is no Wine to run it; apt-get install wine64")
    shutil.copy(program, folder / "posegrid.exe")
    (folder / "random.c").write_text(RANDOM_NUMBERS)
    done("x86_64-w64-mingw32-gcc", "-shared", "-o", folder / "bcryptprimitives.dll", folder / "random.c", "-ladvapi32")
    program = folder / "posegrid.exe"
    environment = {"WINEDEBUG": "-all", "WINEPREFIX": str(folder / "wine")}
    found = job([wine, program], cell(folder / "cell"), environment=environment)
    return found, f"program {megabytes(program):.1f} MB"


WAYS = {"cargo": by_cargo, "wheel": by_wheel, "deb": by_deb, "container": by_container, "windows": by_windows}


def different(found, first, bytes_too):
    """What differs between the files of two ways, or between what the two told alone."""
    names = found.keys() | first.keys() if bytes_too else {TOLD}
    return sorted(name for name in names if found.get(name) != first.get(name))


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--folder", type=pathlib.Path, required=True)
    arguments.add_argument("--only", action="append", choices=WAYS, help="all where none is named")
    arguments.add_argument("--no-skips", action="store_true", help="what cannot be done here is a failure")
    given = arguments.parse_args()
    folder = given.folder.resolve()
    first, skipped, differs = None, [], []
    for way in given.only or WAYS:
        shutil.rmtree(folder / way, ignore_errors=True)
        (folder / way).mkdir(parents=True)
        try:
            found, told = WAYS[way](folder / way)
        except Skip as reason:
            skipped.append(way)
            print(f"{way}: SKIPPED: {reason}", flush=True)
            continue
        assert len(found) > 10, f"{way}: {sorted(found)}"
        first = first or (way, found)
        other = different(found, first[1], bytes_too=way != "windows")
        if other:
            differs.append(way)
        if other:
            same = f"{len(other)} differ from those of {first[0]}: {', '.join(other[:5])}"
        else:
            same = f"{'told the same as' if way == 'windows' else 'byte for byte those of'} {first[0]}"
        print(f"{way}: the main job and verify are done; {told}; {len(found) - 1} files, {same}", flush=True)
    sys.exit(1 if differs or (given.no_skips and skipped) else 0)


if __name__ == "__main__":
    main()
