//! Joints that a controller reports rounded, as lines for a person.

use crate::judgement::Outcome;
use crate::judgement::rounded::Rounded;

/// One line for each session whose joints are rounded by more than `least_mm` at the target.
pub(in crate::pipeline) fn warned(outcome: &Outcome<'_>, least_mm: f64) -> Vec<String> {
    let slides = outcome.error_frame.arm.chain().slides();
    let sessions = outcome.training.iter().chain(&outcome.test);
    let words = sessions.filter_map(|session| {
        let found = Rounded::of(outcome, session).filter(|found| found.target_mm >= least_mm)?;
        Some(format!("{}: {}", session.name, words(&found, &slides)))
    });
    words.collect()
}

fn words(found: &Rounded, slides: &[bool]) -> String {
    format!(
        "the reported joints are rounded ({}), which is {:.2} mm (rms) at the target, of {:.2} mm that the best model of reported angles \
         leaves: let the controller log all digits",
        steps(&found.steps, slides),
        found.target_mm,
        found.left_mm
    )
}

/// The steps, joints with equal ones together.
fn steps(steps: &[Option<f64>], slides: &[bool]) -> String {
    let mut named: Vec<(String, Vec<String>)> = Vec::new();
    for (joint, (step, slides)) in steps.iter().zip(slides).enumerate() {
        let Some(step) = step else { continue };
        let size = if *slides {
            format!("{} mm", three_digits(*step))
        } else {
            format!("{}°", three_digits(step.to_degrees()))
        };
        let joint = (joint + 1).to_string();
        match named.iter_mut().find(|(own, _)| *own == size) {
            Some((_, joints)) => joints.push(joint),
            None => named.push((size, vec![joint])),
        }
    }
    let named = named.iter().map(|(size, joints)| format!("joint {} to {size}", joints.join(", ")));
    named.collect::<Vec<String>>().join("; ")
}

/// A number with three significant digits, without zeros at its end.
fn three_digits(number: f64) -> f64 {
    format!("{number:.2e}").parse().unwrap_or(number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joints_with_one_step_are_named_together() {
        let coarse = 0.1_f64.to_radians();
        let found = Rounded {
            steps: vec![Some(coarse), None, Some(coarse), Some(0.001), Some(0.5)],
            target_mm: 0.718,
            left_mm: 0.875,
        };
        let words = words(&found, &[false, false, false, false, true]);
        let expected = "the reported joints are rounded (joint 1, 3 to 0.1°; joint 4 to 0.0573°; joint 5 to 0.5 mm), which is 0.72 mm (rms)";
        assert!(words.starts_with(expected), "{words}");
    }
}
