use super::*;
use crate::io::store::Place;
use crate::io::tables::words::VerdictOf;

fn done(verdict: Verdict) -> Done {
    Done {
        session: "a".to_owned(),
        run: "00ff".to_owned(),
        already_there: false,
        reason: (verdict == Verdict::DoesNotMeet).then(|| "test session wed: bound".to_owned()),
        verdict,
        verdict_of: Some(VerdictOf::Compensation),
        rejected: Vec::new(),
        words: vec!["step 100 mm".to_owned(), "bad\u{1b}name".to_owned()],
        tables: Place::of("lake"),
        page: Some(Place::of("lake/report/r/a/00ff.html")),
    }
}

fn met() -> Ending {
    Ending::Done(done(Verdict::Meets))
}

fn not_shown() -> Ending {
    Ending::Done(done(Verdict::NotShown("few".to_owned())))
}

fn failed() -> Ending {
    Ending::Failed(Failure {
        reason: "no log".to_owned(),
        session: None,
    })
}

fn before() -> Ending {
    Ending::Done(Done {
        already_there: true,
        ..done(Verdict::DoesNotMeet)
    })
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
        totals.words(0.5),
        "1 of 6 within 0.5 mm, 2 without a result: 2 done, 1 done before, 2 not met, 2 failed, 1 waiting, 1 stopped\n"
    );
}

#[test]
fn a_paragraph_tells_what_is_new_and_nothing_that_a_terminal_acts_on() {
    assert_eq!(
        paragraph(&not_shown()),
        "a: run 00ff\n  step 100 mm\n  bad\\u{1b}name\n  page: lake/report/r/a/00ff.html\n  tables: lake\n\n"
    );
    assert_eq!(paragraph(&before()), "");
}
