//! Plans of all robots of a pipeline file with several, one after the other: each uses every core. What is wrong with one stays with it.

use std::path::PathBuf;

use super::{PlanArgs, PlanCommandError, made};
use crate::cli::messages::{self, Printable};
use crate::cli::progress::Bars;
use crate::cli::{BAD_USAGE, DONE, NO_RESULT, NOT_MET};
use crate::pipeline::file::ROBOT_PLACE;
use crate::pipeline::planning::Planning;

/// Names of the robots to plan for; empty where the pipeline file is of one.
pub(super) fn robots(args: &PlanArgs) -> Result<Vec<String>, PlanCommandError> {
    let known = Planning::robots(&args.pipeline).map_err(Box::new)?;
    let robots = match &args.robot {
        Some(robot) if !known.is_empty() => vec![robot.clone()],
        Some(_) | None => known,
    };
    match &args.out {
        Some(csv) if robots.len() > 1 && !csv.to_string_lossy().contains(ROBOT_PLACE) => {
            Err(PlanCommandError::OneFile(csv.clone()))
        }
        _ => Ok(robots),
    }
}

/// Makes the plan of each of these robots and prints it as soon as it is there; gives the exit code of all.
pub(super) fn all(args: &PlanArgs, robots: &[String], bars: &Bars) -> u8 {
    let mut codes = Vec::new();
    for robot in robots {
        let own = of(args, robot);
        let (code, words) = match made(&own, bars) {
            Ok((true, words)) => (DONE, words),
            Ok((false, words)) => (NOT_MET, words),
            Err(error) => {
                let reason = Printable(&error.to_string()).to_string();
                tracing::error!("{}: {reason}", Printable(robot));
                (error.exit_code(), format!("no plan: {reason}\n"))
            }
        };
        codes.push(code);
        let words =
            if robots.len() > 1 { format!("robot {}\n{words}\n", Printable(robot)) } else { words };
        if let Err(undelivered) = messages::result(words, bars) {
            return undelivered.exit_code();
        }
    }
    of_all(&codes)
}

fn of(args: &PlanArgs, robot: &str) -> PlanArgs {
    let named = |csv: &PathBuf| PathBuf::from(csv.to_string_lossy().replace(ROBOT_PLACE, robot));
    PlanArgs { robot: Some(robot.to_owned()), out: args.out.as_ref().map(named), ..args.clone() }
}

/// The exit code of plans with these: what is wrong with the files of all robots is wrong with the pipeline file.
fn of_all(codes: &[u8]) -> u8 {
    let any = |of: &[u8]| codes.iter().any(|code| of.contains(code));
    if codes.iter().all(|code| *code == BAD_USAGE) {
        BAD_USAGE
    } else if any(&[NO_RESULT, BAD_USAGE]) {
        NO_RESULT
    } else if any(&[NOT_MET]) {
        NOT_MET
    } else {
        DONE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_robot_without_a_plan_outranks_one_whose_plan_does_not_meet_the_tolerance() {
        for (codes, of_all_wanted) in [
            (vec![DONE, DONE], DONE),
            (vec![DONE, NOT_MET], NOT_MET),
            (vec![NOT_MET, NO_RESULT], NO_RESULT),
            (vec![DONE, BAD_USAGE], NO_RESULT),
            (vec![BAD_USAGE, BAD_USAGE], BAD_USAGE),
        ] {
            assert_eq!(of_all(&codes), of_all_wanted, "{codes:?}");
        }
    }
}
