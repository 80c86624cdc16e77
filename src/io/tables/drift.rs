//! `drift`: what moved between sessions, suspect by suspect, and how far.

use super::PublishError;
use crate::history::compare::{ChiSquare, Shift};
use crate::history::suspects::{Asked, Suspect};
use crate::io::schema;
use crate::io::table::{Columns, Table};
use crate::pipeline::history::{PastSession, RobotHistory};

/// One row: a test, or how far a component moved.
struct Row<'a> {
    session: &'a PastSession,
    lasting: Option<bool>,
    suspect: Suspect,
    asked: Option<&'a Asked>,
    shift: Option<&'a Shift>,
}

/// The table of all robots.
pub fn drift(robots: &[RobotHistory]) -> Result<Table, PublishError> {
    let rows: Vec<Row<'_>> = robots
        .iter()
        .flat_map(|robot| rows(&robot.sessions))
        .collect();
    let of = || rows.iter();
    let key = || of().map(|row| &row.session.key);
    let judged = || of().map(|row| &row.session.judged);
    let began = |row: &Row<'_>| {
        let words = &row.session.judged.began;
        (!words.is_empty()).then(|| words.join("; "))
    };
    let columns = Columns::new(schema::find("drift")?, rows.len())
        .column("robot", key().map(|key| key.robot.as_str()))
        .column("session", key().map(|key| key.session.as_str()))
        .column("run", key().map(|key| key.run.as_str()))
        .column("measured_at_ns", of().map(|row| row.session.measured_at_ns))
        .column("segment", judged().map(|judged| judged.segment))
        .column("began", of().map(began))
        .column("against", judged().map(|judged| judged.against))
        .column("suspect", of().map(|row| row.suspect.word()))
        .column("joint", of().map(|row| row.suspect.joint()))
        .column("verdict", of().map(verdict))
        .column("lasting", of().map(|row| row.lasting));
    Ok(shifts(tests(columns, &rows), &rows).finish()?)
}

fn tests(columns: Columns, rows: &[Row<'_>]) -> Columns {
    let test = |of: fn(&Asked) -> ChiSquare| rows.iter().map(move |row| row.asked.map(of));
    [
        ("", test(|asked| asked.alone)),
        ("remainder_", test(|asked| asked.remainder)),
    ]
    .into_iter()
    .fold(columns, |columns, (prefix, test)| {
        let of = || test.clone();
        columns
            .column(
                &format!("{prefix}chi_square"),
                of().map(|test| Some(test?.statistic)),
            )
            .column(
                &format!("{prefix}degrees_of_freedom"),
                of().map(|test| Some(test?.freedom)),
            )
            .column(
                &format!("{prefix}p_value"),
                of().map(|test| Some(test?.p_value())),
            )
    })
}

fn shifts(columns: Columns, rows: &[Row<'_>]) -> Columns {
    let shift = || rows.iter().map(|row| row.shift);
    columns
        .column(
            "component",
            shift().map(|shift| Some(shift?.column.to_string())),
        )
        .column("shift", shift().map(|shift| Some(shift?.value)))
        .column("standard_error", shift().map(|shift| Some(shift?.sd)))
        .column("unit", shift().map(|shift| Some(shift?.column.unit_name())))
}

fn rows(sessions: &[PastSession]) -> Vec<Row<'_>> {
    let lasting = RobotHistory::lasting(sessions);
    let each = sessions.iter().zip(lasting);
    each.flat_map(|(session, lasting)| of_session(session, lasting))
        .collect()
}

fn of_session(session: &PastSession, lasting: Option<bool>) -> Vec<Row<'_>> {
    let judged = &session.judged;
    let row = |suspect, asked, shift| Row {
        session,
        lasting,
        suspect,
        asked,
        shift,
    };
    if judged.asked.is_empty() {
        return vec![row(Suspect::Anything, None, None)];
    }
    let tests = judged
        .asked
        .iter()
        .map(|asked| row(asked.suspect, Some(asked), None));
    let named = judged.finding.named();
    let shifts = judged.moved.iter().filter_map(|shift| {
        let suspect = named.iter().find(|suspect| suspect.has(&shift.column))?;
        Some(row(*suspect, None, Some(shift)))
    });
    let is_asked =
        |suspect: &&Suspect| !judged.asked.iter().any(|asked| asked.suspect == **suspect);
    let anew = judged
        .set_up_anew
        .iter()
        .filter(is_asked)
        .map(|suspect| row(*suspect, None, None));
    tests.chain(shifts).chain(anew).collect()
}

fn verdict(row: &Row<'_>) -> &'static str {
    let judged = &row.session.judged;
    if judged.set_up_anew.contains(&row.suspect) {
        return "set_up_anew";
    }
    if row.asked.is_none() && row.shift.is_none() {
        return "not_shown";
    }
    judged.finding.verdict_of(row.suspect)
}
