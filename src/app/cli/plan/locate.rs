//! `posegrid plan --locate`: the poses that find base and reflector after a remount, as words and as CSV.

use std::fmt::Write as _;
use std::io::Write;

use super::{PlanArgs, PlanCommandError, WriteCause, new_csv};
use crate::files::whole_file::write_whole;
use crate::kinematics::Joint;
use crate::pipeline::planning::Located;
use crate::plan::compare::Expected;

/// Chooses the poses; whether errors are expected within the tolerance, and a text that says so.
pub(super) fn located(args: &PlanArgs, count: usize) -> Result<(bool, String), PlanCommandError> {
    new_csv(args)?;
    let (robot, lake) = (args.robot.as_deref(), args.lake.as_deref());
    let located = Located::make(&args.pipeline, robot, lake, count).map_err(Box::new)?;
    if let Some(path) = &args.out {
        let write = |sink: &mut std::io::BufWriter<&std::fs::File>| csv(&located, sink);
        write_whole(path, write)
            .map_err(|source| PlanCommandError::Write { path: path.clone(), source })?;
    }
    Ok((located.plan.is_met(&located.settings), words(&located, args)))
}

fn words(located: &Located, args: &PlanArgs) -> String {
    let (plan, key) = (&located.plan, &located.identified_by);
    let what = if located.with_target { "base and reflector" } else { "base" };
    let mut text = format!(
        "{} poses that find {what} of robot {:?}, whose arm run {} of session {} identified\n",
        plan.poses.len(),
        key.robot,
        key.run,
        key.session
    );
    for (place, pose) in plan.poses.iter().enumerate() {
        let joints = pose.joints.iter().zip(located.arm.joints());
        let value = |(q, joint): (&f64, &Joint)| {
            let unit = if joint.slides { " mm" } else { "" };
            format!("{:.3}{unit}", joint.shown(*q))
        };
        let joints: Vec<String> = joints.map(value).collect();
        writeln!(text, "  p{place:<3} joints {}°", joints.join(" ")).expect("a string");
    }
    let share = 100.0 * located.settings.tolerance.share;
    let line = |expected: &Expected| {
        format!("mean {:.3} mm, {share} % within {:.3} mm", expected.mean_mm, expected.share_mm)
    };
    let promise = line(&plan.promise);
    writeln!(text, "expected errors over the box, drift still to come included: {promise}")
        .expect("a string");
    for (poses, expected) in &plan.others {
        writeln!(text, "  with {poses} poses: {}", line(expected)).expect("a string");
    }
    let alone = line(&plan.arm_alone);
    writeln!(text, "  with the whole box measured: {alone}, which only a better arm improves")
        .expect("a string");
    let is_met = if plan.is_met(&located.settings) { "expected" } else { "not expected" };
    let tolerance_mm = located.settings.tolerance.mm;
    writeln!(text, "tolerance {tolerance_mm} mm: {share} % of errors {is_met} within it")
        .expect("a string");
    text += "to judge a session so: [report] locate = { by = \"chosen\", stations = N, target = \"own\" }, and the session under [input] test\n";
    if let Some(csv) = &args.out {
        writeln!(text, "poses: {}", csv.display()).expect("a string");
    }
    text
}

/// The poses in their order: names, joint angles in degrees, and the reflector's nominal pose in the base frame.
fn csv(located: &Located, sink: impl Write) -> Result<(), WriteCause> {
    let mut writer = csv::Writer::from_writer(sink);
    let joints = located.arm.joints();
    let header = ["target", "x_mm", "y_mm", "z_mm", "qx", "qy", "qz", "qw"];
    let names = (1..).zip(joints).map(|(place, joint)| format!("q{place}_{}", joint.unit()));
    writer.write_record(header.map(str::to_owned).into_iter().chain(names))?;
    for (place, pose) in located.plan.poses.iter().enumerate() {
        let target = located.command_from_base * pose.base_from_target;
        let (position, turn) = (target.translation.vector, target.rotation.coords);
        let lengths = position.iter().map(|mm| format!("{mm:.6}"));
        let turns = turn.iter().map(|part| format!("{part:.12}"));
        let angles = pose.joints.iter().zip(joints);
        let angles = angles.map(|(q, joint)| format!("{:.9}", joint.shown(*q)));
        let name = std::iter::once(format!("p{place}"));
        writer.write_record(name.chain(lengths).chain(turns).chain(angles))?;
    }
    Ok(writer.flush()?)
}
