//! `posegrid history` on lakes that `posegrid run` wrote: order, what is left out, what is kept, and the files written.

use crate::cell;
mod simulated;
mod slides;

use std::fs;
use std::path::Path;

use cell::{Cell, Ended, ended, files, posegrid};
use posegrid::files::schema;
use posegrid::files::table::{self, Table};

/// Three sessions with the same logs, so that nothing can have moved; their names give the order.
fn three() -> Cell {
    let cell = Cell::new()
        .with("harmonics = 12", "enabled = false")
        .with_quickstart("mon")
        .with_quickstart("tue")
        .with_quickstart("wed");
    let run = cell.run(&[]);
    assert!(run.code == 0 || run.code == 3, "{}", run.messages);
    cell
}

fn history(cell: &Cell, arguments: &[&str]) -> Ended {
    ended(posegrid().arg("history").arg(cell.path("lake")).args(arguments))
}

fn table(folder: &Path, name: &str) -> Table {
    let schema = schema::find(name).expect("a published table");
    table::read(&folder.join(format!("{name}.parquet")), schema).expect("by its schema")
}

#[test]
fn a_history_is_reported_kept_and_written() {
    let cell = three();
    let first = history(&cell, &[]);
    first.expect(
        0,
        &[
            "kr210-demo: 3 sessions, mon to wed",
            "newest: nothing moved, compared with 2 sessions before",
        ],
    );
    assert!(cell.path("lake/.history/kr210-demo.jsonl.zst").exists());
    // From what was kept, anew, and after what was kept is damaged: the same words.
    let again = history(&cell, &[]);
    let fresh = history(&cell, &["--fresh"]);
    let kept = cell.path("lake/.history/kr210-demo.jsonl.zst");
    let mut bytes = fs::read(&kept).expect("kept");
    bytes.truncate(bytes.len() / 2);
    fs::write(&kept, bytes).expect("writable");
    let damaged = history(&cell, &[]);
    // From the figures that the runs kept, and from the tables where these are gone, which keeps them again.
    let figures = cell.path("lake/.history/figures");
    let of_runs = files(&figures);
    fs::remove_dir_all(cell.path("lake/.history")).expect("there");
    let without = history(&cell, &[]);
    assert!(of_runs.len() == 3 && files(&figures) == of_runs);
    for other in [again, fresh, damaged, without] {
        assert_eq!((other.code, &other.results), (0, &first.results));
    }
    let out = cell.path("trend");
    let written = history(&cell, &["--out", &out.display().to_string()]);
    written.expect(0, &["history.parquet", "drift.parquet", "kr210-demo.html"]);
    let (history_rows, drift) = (table(&out, "history"), table(&out, "drift"));
    let sessions = |table: &Table| -> Vec<String> {
        let mut names: Vec<String> =
            table.text("session").iter().flatten().map(str::to_owned).collect();
        names.dedup();
        names
    };
    assert_eq!(sessions(&history_rows), ["mon", "tue", "wed"]);
    assert_eq!(sessions(&drift), ["mon", "tue", "wed"]);
    let verdicts: Vec<&str> = drift.text("verdict").iter().flatten().collect();
    assert!(
        verdicts[0] == "not_shown" && verdicts[1..].iter().all(|verdict| *verdict == "no_change"),
        "{verdicts:?}"
    );
    let page = fs::read_to_string(out.join("kr210-demo.html")).expect("a page");
    assert!(page.contains("Nothing moved") && !page.contains("<script"));
    assert!(!page.contains("../report/"), "outside the lake it leads to no page of a run");
    assert!(out.join("index.html").exists());
}

#[test]
fn pages_in_the_lake_lead_to_those_of_its_runs_and_back() {
    let cell = three();
    assert!(cell.path("lake/pages/index.html").exists(), "the batch has written them");
    fs::remove_dir_all(cell.path("lake/pages")).expect("removable");
    let one = history(&cell, &["--pages", "--robot", "kr210-demo"]);
    one.expect(0, &["lake/pages/kr210-demo.html"]);
    assert!(!cell.path("lake/pages/index.html").exists(), "the fleet is not of one robot of it");
    history(&cell, &["--pages"]).expect(0, &["lake/pages/index.html"]);
    let page = fs::read_to_string(cell.path("lake/pages/kr210-demo.html")).expect("a page");
    let linked = page.split("href=\"../report/").skip(1).map(|rest| rest.split('"').next());
    let linked: Vec<&str> = linked.flatten().collect();
    let sessions: Vec<&str> = linked.iter().filter_map(|own| own.split('/').nth(1)).collect();
    assert_eq!(sessions, ["wed", "tue", "mon"], "the newest first");
    for own in linked {
        let run = fs::read_to_string(cell.path("lake/report").join(own)).expect("a page");
        for name in ["kr210-demo.html", "index.html"] {
            assert!(run.contains(&format!("href=\"../../../pages/{name}\"")), "{own}");
        }
    }
    let verified = ended(posegrid().arg("verify").arg(cell.path("lake")));
    assert!(!verified.results.contains("foreign"), "{}", verified.results);
}

#[test]
fn every_run_is_used_or_left_out_with_its_reason() {
    let cell = three();
    // Another setting is another run of mon, which begins a segment; tue's model is damaged; wed's row is no Parquet file.
    let cell = cell.with("mm = 0.5", "mm = 0.6");
    let run = cell.run(&["mon"]);
    assert!(run.code == 0 || run.code == 3, "{}", run.messages);
    let model = cell.table_file("calibrations", "tue");
    let mut bytes = fs::read(&model).expect("there");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x10;
    fs::write(&model, bytes).expect("writable");
    fs::write(cell.table_file("runs", "wed"), "not a table").expect("writable");
    fs::write(cell.path("lake/runs/notes.txt"), "of somebody").expect("writable");
    // The tables themselves are read: of tue what its run kept is sound.
    let told = history(&cell, &["--fresh"]);
    told.expect(
        3,
        &[
            "kr210-demo: 1 sessions, mon to mon",
            "runs: 4, 1 used; left out: 2 not readable, 1 replaced by another run",
            "is not what its run wrote",
            "restore it from a copy",
        ],
    );
}

#[test]
fn bad_usage_is_reported() {
    let cell = Cell::new();
    history(&cell, &[]).expect(2, &["there is no lake in"]);
    let cell = three();
    history(&cell, &["--robot", "ur5"])
        .expect(2, &["has no robot \"ur5\"; its robots: kr210-demo"]);
    history(&cell, &["--since", "sun"]).expect(2, &["has no session \"sun\""]);
    let since = history(&cell, &["--since", "tue", "--until", "tue"]);
    since.expect(0, &["1 sessions, tue to tue", "2 not asked for"]);
}
