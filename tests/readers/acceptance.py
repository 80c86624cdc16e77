"""Reads the acceptance reports of a lake's runs with pypdf, and holds their figures against the lake as DuckDB reads it.

    python tests/readers/acceptance.py POSEGRID LAKE [--folder FOLDER]

Checked of every run: the same bytes from `runs` and from `accuracy`, and again; two pages at most; fonts that are embedded with their map to
Unicode; no date of the day; what the standard asks stands in the first table; verdict, means, bound and U, every figure of ISO 9283 over all poses, run, digests of inputs and of the row; what
no table states stands as not stated; it calls itself no certificate but to say so. A table that no report is made of is refused with those
that one is made of.
"""

import argparse
import pathlib
import re
import subprocess
import sys
import tempfile

import duckdb
import pypdf

SHOWN = ("AP_p", "RP_l", "RP_a", "RP_b", "RP_c", "AD_p", "RD", "vAP_p", "dAP_p")
HEADLINES = {
    "met": "Tolerance met",
    "not_met": "Tolerance not met",
    "not_shown": "Not shown to meet the tolerance",
}

problems = []


def expect(holds, what):
    if not holds:
        problems.append(what)


def export(posegrid, table, out=None):
    command = [posegrid, "export", str(table), "--format", "acceptance"] + (["--out", str(out)] if out else [])
    return subprocess.run(command, capture_output=True)


def embedded(page):
    """Names of the fonts of a page; each has to have its file and its map to Unicode."""
    fonts = [font.get_object() for font in page["/Resources"]["/Font"].values()]
    for font in fonts:
        own = font["/DescendantFonts"][0].get_object()
        described = own["/FontDescriptor"].get_object()
        expect({"/FontFile2", "/FontFile3"} & set(described), f"{font['/BaseFont']} is not embedded")
        expect("/ToUnicode" in font, f"{font['/BaseFont']} has no map to Unicode")
    return [str(font["/BaseFont"]) for font in fonts]


def fixed(value, digits=3):
    text = f"{value:.{digits}f}"
    return text.replace("-", "−") if float(text) else text.lstrip("-")


def check(posegrid, lake, run, folder):
    [row] = duckdb.sql(f"FROM '{run}'").df().to_dict("records")
    accuracy = lake / "accuracy" / run.relative_to(lake / "runs")
    made = [export(posegrid, table).stdout for table in (run, accuracy, run)]
    expect(made[0] and made[0] == made[1] == made[2], f"{run}: bytes differ")
    file = folder / f"{row['run']}.pdf"
    expect(export(posegrid, run, file).returncode == 0 and file.read_bytes() == made[0], f"{run}: --out differs")
    reader = pypdf.PdfReader(file)
    fonts = {font for page in reader.pages for font in embedded(page)}
    expect(fonts and all("DejaVu" in font for font in fonts), f"{run}: fonts {fonts}")
    expect("/CreationDate" not in reader.metadata and "/ModDate" not in reader.metadata, f"{run}: has a date of its own")
    # Lines are broken where a column ends, and digests wherever they are.
    text = re.sub(r"\s", "", "".join(page.extract_text() for page in reader.pages))

    def has(*wanted):
        for own in wanted:
            expect(re.sub(r"[\s`]", "", own) in text, f"{run}: lacks {own!r}")

    figures = duckdb.sql(
        f"SELECT name, value, unit, expanded_uncertainty AS u FROM '{accuracy}' WHERE value IS NOT NULL AND pose IS NULL "
        "AND quantity IN ('iso_9283', 'position_error') AND NOT (split = 'session' AND base_refit = 'none')"
    ).fetchall()
    iso = [(name, value, unit) for name, value, unit, _ in figures if name in SHOWN]
    expect(len(reader.pages) <= 2, f"{run}: {len(reader.pages)} pages")
    first = [text.find(re.sub(r"\s", "", own)) for own in ("What ISO 9283 asks", "Warm-up", "What was measured", HEADLINES[row["verdict"]])]
    expect(0 <= first[0] and first == sorted(first), f"{run}: what was not done does not stand first")
    has("Acceptance report", HEADLINES[row["verdict"]], row["run"], row["row_digest"], row["settings_digest"], row["statement"][1:])
    has("Warm-up", "Speed", "serial number: not stated", f"began {row['session_started']:%Y-%m-%d %H:%M:%S} UTC", *row["warnings"])
    has(*row["input_digests"], f"Mean error {fixed(row['mean_before_mm'])} mm before, {fixed(row['mean_after_mm'])} mm after")
    for name, value, unit in iso:
        has(f"{fixed(1e6 * value, 0)} µrad" if unit == "rad" else f"{fixed(value)} {unit}")
    bounds = [(value, u) for name, value, _, u in figures if name == "bound" and value == row["bound_mm"]]
    if bounds:
        has(fixed(bounds[0][0]), f"U = {fixed(bounds[0][1])} mm (k = 2)")
    expect(text.count("certificate") == text.count("itisnocertificate") == 1, f"{run}: calls itself a certificate")
    print(f"{file}: {len(reader.pages)} pages, {len(made[0])} bytes, {len(iso)} figures of ISO 9283")


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("posegrid")
    arguments.add_argument("lake", type=pathlib.Path)
    arguments.add_argument("--folder", type=pathlib.Path)
    given = arguments.parse_args()
    folder = given.folder or pathlib.Path(tempfile.mkdtemp())
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.pdf"):
        old.unlink()
    runs = sorted(given.lake.glob("runs/*/*/*.parquet"))
    expect(runs, f"{given.lake} has no run")
    for run in runs:
        check(given.posegrid, given.lake, run, folder)
    other = next(given.lake.glob("residuals/*/*/*.parquet"))
    refused = export(given.posegrid, other)
    expect(refused.returncode == 2 and b'"runs"' in refused.stderr, f"{other}: {refused.stderr.decode()}")
    sys.exit("\n".join(problems) or None)


main()
