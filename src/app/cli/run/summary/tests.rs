use super::*;
use crate::io::tables::words::VerdictOf;
use crate::manifest::RunKey;
use crate::pipeline::summary::Summary;
use crate::report::next::{Instead, Stated};
use crate::report::verdict::Applied;

fn done(verdict: Verdict) -> Box<Done> {
    Box::new(Done {
        key: RunKey::new("r", "a", "00ff"),
        already_there: false,
        asked: 1,
        took_place: None,
        reason: (verdict == Verdict::DoesNotMeet).then(|| "test session wed: bound".to_owned()),
        verdict,
        verdict_of: Some(VerdictOf::Compensation),
        rejected: Vec::new(),
        summary: Some(summary()),
        words: vec!["step 100 mm".to_owned()],
        corrects: Some(Place::of("lake/compensation/r/a b/00ff.parquet")),
        tables: Place::of("lake"),
        page: Some(Place::of("lake/report/r/a/00ff.html")),
        took: None,
    })
}

fn summary() -> Summary {
    Summary {
        read: "a: 100 stations, 99 measured, 1 not".to_owned(),
        warnings: vec!["the log is damaged".to_owned()],
        findings: vec!["tolerance 0.5 mm: bad\u{1b}name".to_owned()],
        next: Next {
            by: Applied::Table,
            stated: Stated::Joints,
            first: "",
            sets_base: false,
            instead: Some(Instead { words: "measure more".to_owned(), allow: "not-shown" }),
        },
    }
}

fn met() -> Ending {
    Ending::Done(done(Verdict::Meets))
}

fn not_shown() -> Ending {
    Ending::Done(done(Verdict::NotShown("few".to_owned())))
}

fn failed() -> Ending {
    Ending::Failed(Failure { reason: "no log".to_owned(), session: None })
}

fn before() -> Ending {
    Ending::Done(Box::new(Done {
        already_there: true,
        summary: None,
        ..*done(Verdict::DoesNotMeet)
    }))
}

fn waits(before: usize) -> SetAside {
    SetAside {
        session: "wed\nfailed".to_owned(),
        why: Why::Waits("tracker.mcap is not there yet".to_owned()),
        before,
    }
}

fn bad() -> SetAside {
    SetAside {
        session: "pooled".to_owned(),
        why: Why::Bad("that is no name".to_owned()),
        before: 9,
    }
}

fn code(endings: &[Ending], aside: &[SetAside]) -> u8 {
    exit_code(endings, aside, &Stop::default())
}

#[test]
fn no_result_outranks_a_missed_tolerance_and_waiting_is_neither() {
    assert_eq!(code(&[met()], &[]), 0);
    assert_eq!(code(&[met()], &[waits(0)]), 0);
    assert_eq!(code(&[], &[waits(0)]), 0);
    assert_eq!(code(&[met(), not_shown()], &[]), 3);
    assert_eq!(code(&[before()], &[waits(0)]), 3);
    assert_eq!(code(&[not_shown(), failed()], &[]), 1);
    assert_eq!(code(&[met()], &[bad()]), 1);
    let mut rejected = done(Verdict::Meets);
    rejected.rejected.push("6 of 100 readings".to_owned());
    assert_eq!(code(&[Ending::Done(rejected)], &[]), 3);
}

#[test]
fn each_session_has_one_line_in_the_order_of_the_plan() {
    let endings = [met(), before(), failed(), Ending::NotStarted];
    let named = ["a", "b", "c", "d"].into_iter().zip(&endings);
    let lines = lines(named, &[waits(1), bad()]);
    let expected = [
        "done         a: within tolerance by the compensation table, run 00ff",
        "waits        wed\\nfailed: tracker.mcap is not there yet",
        "done-before  b: not within tolerance by the compensation table: test session wed: bound, run 00ff, page lake/report/r/a/00ff.html",
        "failed       c: no result: no log",
        "not-started  d: run it again",
        "failed       pooled: no result: that is no name",
    ];
    assert_eq!(lines.lines().collect::<Vec<_>>(), expected);
}

#[test]
fn totals_count_every_session_once() {
    let endings = [met(), before(), not_shown(), failed(), Ending::Stopped];
    let totals = Totals::of(&endings, &[waits(0), bad()]);
    // Of seven: two new and one done before, of which two do not meet; two failed, one waits, one was stopped.
    assert_eq!(
        totals.words(None, Some(0.5)),
        "1 of 6 within 0.5 mm, 2 without a result: 2 done, 1 done before, 2 not met, 2 failed, 1 waiting, 1 stopped\n"
    );
}

#[test]
fn a_paragraph_is_short_and_has_nothing_that_a_terminal_acts_on() {
    let short = "a: 100 stations, 99 measured, 1 not\n  warning: the log is damaged\n  tolerance 0.5 mm: bad\\u{1b}name\n  \
                 now: measure more; to correct targets all the same: posegrid compensate 'lake/compensation/r/a b/00ff.parquet' targets.csv \
                 --out corrected.csv --allow not-shown\n  page: lake/report/r/a/00ff.html\n";
    assert_eq!(paragraph("a", &not_shown(), false), format!("{short}\n"));
    assert_eq!(
        paragraph("a", &not_shown(), true),
        format!("{short}  run: 00ff\n  step 100 mm\n  tables: lake\n\n")
    );
    assert_eq!(paragraph("a", &before(), true), "");
}

#[test]
fn a_table_on_object_storage_is_copied_first() {
    let line = now(&summary().next, &Place::of("s3://bucket/lake/x.parquet"));
    assert!(line.contains("with a copy of the table on this machine"));
    assert_eq!(quoted("it's"), "'it'\\''s'");
}
