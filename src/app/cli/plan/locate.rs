//! `posegrid plan --locate`: the poses that find base and reflector after a remount, as words and as CSV.

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
    let mut lines = vec![format!(
        "{} poses that find {what} of robot {:?}, whose arm run {} of session {} identified",
        plan.poses.len(),
        key.robot,
        key.run,
        key.session
    )];
    for (place, pose) in plan.poses.iter().enumerate() {
        let joints = pose.joints.iter().zip(located.arm.joints());
        let value = |(q, joint): (&f64, &Joint)| {
            let unit = if joint.slides { " mm" } else { "" };
            format!("{:.3}{unit}", joint.shown(*q))
        };
        let joints: Vec<String> = joints.map(value).collect();
        lines.push(format!("  p{place:<3} joints {}°", joints.join(" ")));
    }
    let share = 100.0 * located.settings.tolerance.share;
    let line = |expected: &Expected| {
        format!("mean {:.3} mm, {share} % within {:.3} mm", expected.mean_mm, expected.share_mm)
    };
    let promise = line(&plan.promise);
    lines.push(format!("expected errors over the box, drift still to come included: {promise}"));
    let others = plan.others.iter();
    lines.extend(others.map(|(poses, own)| format!("  with {poses} poses: {}", line(own))));
    let alone = line(&plan.arm_alone);
    lines.push(format!("  with the whole box measured: {alone}, which only a better arm improves"));
    let is_met = if plan.is_met(&located.settings) { "expected" } else { "not expected" };
    let tolerance_mm = located.settings.tolerance.mm;
    lines.push(format!("tolerance {tolerance_mm} mm: {share} % of errors {is_met} within it"));
    let judge = "to judge a session so: [report] locate = { by = \"chosen\", stations = N, target = \"own\" }, and the session under [input] test";
    lines.push(judge.to_owned());
    lines.extend(args.out.as_ref().map(|csv| format!("poses: {}", csv.display())));
    lines.join("\n") + "\n"
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
