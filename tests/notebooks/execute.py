"""Executes the notebooks of this folder from the first cell to the last; any cell that fails, fails the whole.

    python tests/notebooks/execute.py LAKE [--keep FOLDER] [--only NAME]

LAKE is what the notebooks read (`POSEGRID_LAKE`). With --keep the executed notebooks, outputs and all, are left in FOLDER.
"""

import argparse
import os
import pathlib
import sys

import nbclient
import nbformat

FOLDER = pathlib.Path(__file__).parent


def execute(path, keep):
    notebook = nbformat.read(path, as_version=4)
    outputs = [cell for cell in notebook.cells if cell.cell_type == "code" and cell.outputs]
    if outputs:
        sys.exit(f"{path}: kept with its outputs; clear them, so that nobody reads yesterday's figures")
    nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
    if keep:
        keep.mkdir(parents=True, exist_ok=True)
        nbformat.write(notebook, keep / path.name)
    print(f"{path.name}: {sum(cell.cell_type == 'code' for cell in notebook.cells)} cells executed")


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("lake", type=pathlib.Path)
    arguments.add_argument("--only", metavar="NAME", action="append", default=[], help="this notebook; all where none is named")
    arguments.add_argument("--keep", type=pathlib.Path)
    given = arguments.parse_args()
    os.environ["POSEGRID_LAKE"] = str(given.lake.resolve())
    paths = [FOLDER / f"{name}.ipynb" for name in given.only] or sorted(FOLDER.glob("*.ipynb"))
    for path in paths:
        execute(path, given.keep)


if __name__ == "__main__":
    main()
