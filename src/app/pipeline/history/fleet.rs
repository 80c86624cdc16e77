//! The histories of robots → the page of the fleet.

use std::collections::BTreeSet;

use super::{Reason, RobotHistory, RunResult};
use crate::io::rows::Word as _;
use crate::io::tables::past::PastSession;
use crate::io::tables::words::TableVerdict;
use crate::page::fleet::content::{Content, DAY_US, Newest, Robot};
use crate::page::fleet::html;
use crate::units::WallTime;

/// The page, as of the start of the newest session, or of a stated time; `pages` are the file names of the robots' pages.
pub fn fleet(robots: &[RobotHistory], pages: &[String], as_of: Option<WallTime>) -> String {
    let own = robots.iter().zip(pages);
    let robots: Vec<Robot> = own.map(|(own, page)| robot(own, page)).collect();
    let newest = robots.iter().filter_map(|own| own.newest.as_ref()?.started);
    html(&Content { is_stated: as_of.is_some(), as_of: as_of.or_else(|| newest.max()), robots })
}

fn robot(own: &RobotHistory, page: &str) -> Robot {
    let unreadable = own.left_out.iter().filter(|own| matches!(own.reason, Reason::Unreadable(_)));
    let newest = own.sessions.last().zip(own.results.last());
    Robot {
        name: own.robot.clone(),
        page: page.to_owned(),
        sessions: own.sessions.len(),
        newest: newest.map(|(session, result)| newest_of(session, result, &own.results)),
        unreadable: unreadable.count(),
    }
}

fn newest_of(session: &PastSession, result: &RunResult, results: &[RunResult]) -> Newest {
    let out = session.judged.out_of_control();
    Newest {
        session: session.key.session.clone(),
        started: result.started_us.map(WallTime::of_us),
        usual_days: usual_days(results),
        verdict: TableVerdict::of_word(&result.verdict).unwrap_or(TableVerdict::NotShown),
        bound_mm: result.bound_mm,
        tolerance_mm: result.tolerance_mm,
        before_mm: result.mean_before_mm,
        after_mm: result.mean_after_mm,
        moved: session.judged.in_words(),
        out_of_control: out.map(str::to_owned).collect(),
    }
}

/// The middle of the times between sessions, days; of an even number the shorter one of both.
fn usual_days(results: &[RunResult]) -> Option<f64> {
    let started: BTreeSet<i64> = results.iter().filter_map(|own| own.started_us).collect();
    let started: Vec<i64> = started.into_iter().collect();
    let mut between: Vec<i64> = started.windows(2).map(|pair| pair[1] - pair[0]).collect();
    between.sort_unstable();
    let middle = (between.len() > 1).then(|| between[(between.len() - 1) / 2])?;
    Some(middle as f64 / DAY_US)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_time_between_sessions_is_their_middle() {
        let at = |day: i64| RunResult {
            started_us: Some(day * 86_400_000_000),
            verdict: "met".to_owned(),
            statement: None,
            mean_before_mm: None,
            mean_after_mm: None,
            means_of: None,
            bound_mm: None,
            tolerance_mm: None,
        };
        let of = |days: &[i64]| usual_days(&days.iter().map(|day| at(*day)).collect::<Vec<_>>());
        assert_eq!(of(&[0, 1, 2, 9, 10]), Some(1.0));
        // Of 1, 3 and 3 days the middle is 3; two sessions have one time between them, which shows nothing usual.
        assert_eq!(of(&[0, 1, 4, 7]), Some(3.0));
        assert_eq!(of(&[0, 1]), None);
    }
}
