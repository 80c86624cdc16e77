//! What stands under a lake and does not belong there, rows of `runs` that were changed or removed, and tables that are not
//! as their run wrote them.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::{ArrayRef, AsArray, Float64Array};
use arrow::datatypes::Float64Type;
use posegrid::io::lake::Lake;
use posegrid::io::tables::runs::row_digest;
use posegrid::pipeline::verify::{Selection, row_contradictions, select};

use super::cell::{Cell, ended, posegrid};
use super::forged::{
    claim_digest, digest_of, of_first_version, rewrite, same_text, seal, seal_row, texts, unsealed,
};
use super::verify::{by_digests, copied, verify};

const ROBOT: &str = "kr210-demo";

fn run_of(cell: &Cell, session: &str) -> String {
    cell.table("runs", session).text("run").value(0).to_owned()
}

/// Copies a file of the cell's lake to another place in it.
fn plant(cell: &Cell, from: &Path, to: &str) -> PathBuf {
    let path = cell.path("lake").join(to);
    fs::create_dir_all(path.parent().expect("in a lake")).expect("writable");
    fs::copy(from, &path).expect("copied");
    path
}

#[test]
fn a_file_that_carries_a_runs_id_and_is_none_of_its_files_is_foreign() {
    let cell = copied();
    let run = run_of(&cell, "mon");
    let own = cell.table_file("accuracy", "mon");
    verify(&cell, &[]).expect(0, &["42 files in the lake: 40 of runs, 2 the lake's own"]);
    // The lake's own files are known.
    fs::write(cell.path("lake/.lock"), "process 1").expect("writable");
    ended(posegrid().arg("history").arg(cell.path("lake"))).no_defect();
    by_digests(&cell, &[]).expect(0, &["44 files in the lake: 40 of runs, 4 the lake's own"]);
    let forged = plant(&cell, &own, "accuracy/r/x/zz.parquet");
    let says = format!(
        "foreign: {}: it states that it is table accuracy of run {run} of robot \"{ROBOT}\" and session \"mon\"",
        forged.display()
    );
    by_digests(&cell, &[]).expect(3, &[&says, "2 runs: 2 not recomputed", "1 foreign"]);
    // Of a part of the lake, what stands in its folders.
    let part = by_digests(&cell, &["mon"]);
    part.expect(0, &["others not looked at"]);
    assert!(!part.results.contains("foreign"), "{}", part.results);
    // Under the run's own name, in a folder of the same session, where its row names no such file.
    let named = format!("history/{ROBOT}/mon/{run}.parquet");
    let named = plant(&cell, &own, &named);
    let told =
        format!("foreign: {}: the row of run {run} in runs does not name it", named.display());
    by_digests(&cell, &["mon"]).expect(3, &[&told]);
    fs::remove_file(&named).expect("there");
    fs::remove_file(&forged).expect("there");
    // Whatever else: beside the tables, too deep, of another kind, by folders as a whole.
    let others = [
        "README.txt",
        "accuracy/kr210-demo/mon/notes.csv",
        "accuracy/kr210-demo/mon/copies/a.parquet",
        "accuracy/kr210-demo/mon/copies/b.parquet",
        "figures/one/two/three/four/five.png",
    ];
    for other in others {
        plant(&cell, &own, other);
    }
    let all = by_digests(&cell, &[]);
    let place = |name: &str| format!("foreign: {}", cell.path("lake").join(name).display());
    all.expect(
        3,
        &[
            &place(others[0]),
            &place(others[1]),
            &format!("{}, a folder of 2 files", place("accuracy/kr210-demo/mon/copies")),
            &place("figures"),
            "5 foreign",
        ],
    );
}

#[test]
fn files_of_a_run_without_a_row_are_reported_with_both_causes() {
    let cell = copied();
    let run = run_of(&cell, "tue");
    // What a stopped run leaves under a temporary name is no mismatch: the next run removes it.
    let temporary = format!("accuracy/{ROBOT}/tue/.{run}.parquet.tmp-elsewhere-12-34-0");
    plant(&cell, &cell.table_file("accuracy", "mon"), &temporary);
    by_digests(&cell, &[]).expect(0, &["temporary: ", &temporary, "1 temporary"]);
    fs::remove_file(cell.table_file("runs", "tue")).expect("there");
    let told = [
        &*format!("no row: 13 files of run {run} of robot {ROBOT} have no row in runs"),
        "the row was deleted, or the run was never committed",
        "of session tue accuracy, calibrations, ",
        "1 run: 1 not recomputed",
    ];
    by_digests(&cell, &[]).expect(3, &told);
    // By its name too, and when no other row is left.
    let missing = format!("13 files of run {run}");
    let bare = |name: &str| ended(posegrid().arg("verify").arg(cell.path("lake")).arg(name));
    bare(&run).expect(3, &[&missing]);
    fs::remove_file(cell.table_file("runs", "mon")).expect("there");
    let all = ended(posegrid().arg("verify").arg(cell.path("lake")));
    all.expect(3, &[&missing, "13 files of run ", "0 runs"]);
}

#[test]
fn every_column_of_a_row_is_sealed() {
    let cell = copied();
    let row = cell.table_file("runs", "mon");
    let sound = fs::read(&row).expect("there");
    let told = [
        "row of runs altered",
        "runs: its content has the digest ",
        "runs: the content of its file has the digest ",
    ];
    for column in ["platform", "verdict", "counts"] {
        rewrite(&row, |own, _| {
            (own == column).then(|| same_text(if column == "verdict" { "not_met" } else { "x" }, 1))
        });
        by_digests(&cell, &["mon"]).expect(3, &told);
        fs::write(&row, &sound).expect("writable");
    }
    rewrite(&row, |own, array| (own == "cpu_features").then(|| texts(array, str::to_uppercase)));
    by_digests(&cell, &["mon"]).expect(3, &told);
    // The same content, written anew by another program.
    fs::write(&row, &sound).expect("writable");
    rewrite(&row, |_, _| None);
    by_digests(&cell, &["mon"])
        .expect(3, &["row of runs altered", "is not what posegrid writes for this content"]);
}

#[test]
fn a_flipped_bit_anywhere_in_a_row_is_reported() {
    let cell = copied();
    let lake = Lake::new(cell.path("lake"));
    let row = cell.table_file("runs", "mon");
    let sound = fs::read(&row).expect("there");
    let is_told = || {
        let selected = select(&lake, &Selection::default()).expect("a lake");
        let own = selected.runs.iter().find(|run| run.place.named() == row);
        let own = own.expect("its row is listed");
        own.claim.as_ref().map_or(true, |claim| {
            !row_contradictions(own, claim, &selected.register, &lake).is_empty()
        })
    };
    assert!(!is_told(), "sound");
    // Every 151st bit: each place of a bit in its byte has its turn.
    let bits = (0..8 * sound.len()).step_by(151);
    for bit in bits {
        let mut bytes = sound.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        fs::write(&row, &bytes).expect("writable");
        assert!(is_told(), "bit {bit}");
    }
    fs::write(&row, sound).expect("writable");
    // One that cannot be read at all is altered too, and its files are not taken for foreign ones.
    let file = fs::File::options().write(true).open(&row).expect("there");
    file.set_len(100).expect("writable");
    let ended = by_digests(&cell, &[]);
    ended.expect(3, &["row of runs not readable", "14 of runs whose rows cannot be read"]);
    assert!(!ended.results.contains("foreign"), "{}", ended.results);
}

#[test]
fn a_row_that_was_replaced_is_reported_when_it_is_changed_with_all_its_digests() {
    let cell = copied();
    let first = run_of(&cell, "mon");
    let row = cell.table_file("runs", "mon");
    let cell = cell.with("mm = 0.5", "mm = 0.4");
    assert_ne!(cell.run(&["mon"]).code, 1);
    let sound = by_digests(&cell, &["mon"]);
    assert!(!sound.results.contains("altered"), "{}", sound.results);
    rewrite(&row, |column, _| (column == "platform").then(|| same_text("aarch64-linux", 1)));
    seal_row(&row);
    let told = by_digests(&cell, &["mon"]);
    told.expect(
        3,
        &[
            &format!("run {first}: row of runs altered"),
            "which took its place, states that it had the digest ",
            &format!("cites run {first}, whose place it took: its row in runs is not the one that it was then"),
        ],
    );
    assert_eq!(told.results.matches(": row of runs altered").count(), 1);
}

#[test]
fn rows_from_before_they_had_digests_are_verified_and_said_to_be_so() {
    let cell = copied();
    for session in ["mon", "tue"] {
        of_first_version(&cell.table_file("runs", session));
    }
    let digest = row_digest(&cell.table("runs", "mon"));
    verify(&cell, &[]).expect(
        0,
        &["written before rows carried a digest (version 1 of the table)", "2 runs: 2 the same"],
    );
    // The next run replaces one, and has the digest of its content: from then on a change of it is told.
    let row = cell.table_file("runs", "mon");
    let cell = cell.with("mm = 0.5", "mm = 0.4");
    assert_ne!(cell.run(&["mon"]).code, 1);
    let replaced = fs::read_dir(row.parent().expect("a folder")).expect("there");
    let mut digests = replaced.filter_map(|entry| {
        let path = entry.expect("readable").path();
        let schema = posegrid::files::schema::find("runs").expect("a table");
        let table = posegrid::files::table::read(&path, schema).expect("a row");
        let digest = table.text("replaced_row_digest").iter().flatten().next();
        digest.map(str::to_owned)
    });
    let found = digests.next().expect("of the later one");
    assert_eq!(found, digest);
    rewrite(&row, |column, _| (column == "platform").then(|| same_text("aarch64-linux", 1)));
    by_digests(&cell, &["mon"]).expect(3, &["row of runs altered", "which took its place, states"]);
}

/// Five millimetres more in each node.
fn five_more(array: &ArrayRef) -> ArrayRef {
    let numbers = array.as_primitive::<Float64Type>().iter();
    Arc::new(numbers.map(|x| Some(x? + 5.0)).collect::<Float64Array>())
}

#[test]
fn a_table_that_is_not_what_its_run_wrote_corrects_nothing() {
    let cell = copied();
    let table = cell.table_file("compensation", "mon");
    let targets = cell.path("targets.csv");
    fs::write(&targets, "target,x_mm,y_mm,z_mm\na,1575,33,961\n").expect("writable");
    let compensate = |table: &Path| {
        let mut command = posegrid();
        ended(command.arg("compensate").arg(table).arg(&targets))
    };
    let sound = compensate(&table);
    sound.expect(0, &["1 targets: 1 corrected"]);
    let bytes = fs::read(&table).expect("there");
    let before = digest_of(&table);
    rewrite(&table, |column, array| (column == "error_x_mm").then(|| five_more(array)));
    let told = compensate(&table);
    told.expect(2, &["is not as it was written: its content has the digest "]);
    assert!(told.results.is_empty());
    // With the digest in it changed along, the lake's row still tells; outside the lake nothing can.
    seal(&table, "compensation");
    compensate(&table).expect(2, &["is not what its run wrote", &before]);
    let export = |table: &Path| {
        let mut command = posegrid();
        ended(command.arg("export").arg(table).args(["--format", "csv"]))
    };
    export(&table).expect(2, &["is not what its run wrote"]);
    let outside = cell.path("outside.parquet");
    fs::copy(&table, &outside).expect("copied");
    assert_ne!(compensate(&outside).results, sound.results);
    // With its row changed too, only computing again tells.
    claim_digest(&cell, "compensation", "mon", &before);
    assert_ne!(compensate(&table).code, 2);
    verify(&cell, &["mon"]).expect(3, &["compensation/mon: column error_x_mm"]);

    // The sound table, somewhere in a lake or under another name, or without a row of its run, is not believed either.
    let cell = copied();
    let table = cell.table_file("compensation", "mon");
    assert_eq!(fs::read(&table).expect("there"), bytes);
    let elsewhere = plant(&cell, &table, "compensation/kr210-demo/tue/zz.parquet");
    compensate(&elsewhere).expect(2, &["whose file in the lake", "is another one"]);
    fs::remove_file(cell.table_file("runs", "mon")).expect("there");
    compensate(&table).expect(2, &["has no row of run", "deleted, or the run was never committed"]);
    // Outside it is as good as ever, and says nothing of it.
    fs::copy(&table, &outside).expect("copied");
    let copy = compensate(&outside);
    copy.expect(0, &[]);
    assert_eq!(copy.results, sound.results);
    assert!(!copy.messages.contains("nothing shows"), "{}", copy.messages);
    // A table without a digest is read, and that nothing vouches for it is told; in its lake the row does.
    unsealed(&outside);
    let old = compensate(&outside);
    old.expect(0, &["nothing shows that it is unchanged"]);
    assert_eq!(old.results, sound.results);
    let cell = copied();
    let table = cell.table_file("compensation", "mon");
    let before = digest_of(&table);
    unsealed(&table);
    claim_digest(&cell, "compensation", "mon", &before);
    let in_lake = compensate(&table);
    in_lake.expect(0, &[]);
    assert!(!in_lake.messages.contains("nothing shows"), "{}", in_lake.messages);
}
