//! The source of a correction: either of two tables of a run, distinguished by the table's name in the file.

use std::borrow::Cow;
use std::path::Path;

use super::{CompensateCommandError, Result};
use crate::compensation::slips::Slip;
use crate::compensation::{
    Corrected, Covariances, Exception, Refused, Target, Term, Validity, compensate,
};
use crate::files::table;
use crate::ingest::AngleUnit;
use crate::io::calibrations_table::{self, PublishedArm};
use crate::io::compensation_table::{self, PublishedTable, TableVerdict};
use crate::io::tables::words::CorrectingTable;
use crate::io::targets::{CorrectedBy, JointUnits, Targets};

#[derive(Debug)]
pub(super) enum Source {
    Table(Box<PublishedTable>),
    Arm(Box<PublishedArm>),
}

impl Source {
    pub(super) fn read(path: &Path) -> Result<Self> {
        let held = table::head(path)?.table;
        match held.as_deref() {
            Some("compensation") => Ok(Self::Table(Box::new(compensation_table::read(path)?))),
            Some("calibrations") => Ok(Self::Arm(Box::new(calibrations_table::read(path)?))),
            other => {
                let (path, found) = (path.to_owned(), table::in_words(other));
                Err(CompensateCommandError::OtherTable { path, found })
            }
        }
    }

    /// The units of joint angles in a result in text: those of the targets, mm where the arm's joint slides.
    pub(super) fn units(&self, targets: &Targets) -> JointUnits {
        match self {
            Self::Table(_) => targets.units.clone(),
            Self::Arm(arm) => JointUnits::of(&arm.arm.arm, targets.units.angle()),
        }
    }

    /// The command of each target, or why there is none; `allow` names a reason that does not refuse a target.
    pub(super) fn compensate(
        &self,
        targets: &[Target],
        allow: &[Exception],
        covariances: Covariances,
    ) -> Vec<Result<Corrected, Refused>> {
        let other_tool = Exception::Term(Term::Tool);
        let is_allowed = allow.contains(&other_tool);
        let mut asked = Cow::Borrowed(targets);
        if is_allowed {
            asked.to_mut().iter_mut().for_each(|target| target.tool = None);
        }
        let mut outcomes: Vec<_> = match self {
            Self::Table(own) => asked.iter().map(|target| compensate(&own.table, target)).collect(),
            Self::Arm(own) => own.arm.compensate(&asked, allow, covariances),
        };
        let own = self.validity().conditions.tool.as_ref();
        for (target, outcome) in targets.iter().zip(&mut outcomes) {
            let Ok(done) = outcome else { continue };
            if is_allowed && target.tool.is_some() && target.tool.as_ref() != own {
                done.allowed.push(other_tool);
            }
            if covariances == Covariances::Omitted {
                done.covariance = None;
            }
        }
        outcomes
    }

    /// Names the slip of a unit at each refused target that would have a command without it.
    pub(super) fn name_slips(
        &self,
        targets: &Targets,
        allow: &[Exception],
        outcomes: &mut [Result<Corrected, Refused>],
    ) {
        let may = |slip: &Slip| match slip {
            Slip::RadiansAsDegrees => targets.units.angle() == AngleUnit::Deg,
            Slip::DegreesAsRadians => targets.units.angle() == AngleUnit::Rad,
            Slip::MetresAsMillimetres => true,
        };
        for slip in Slip::ALL.into_iter().filter(may) {
            let refused = outcomes.iter().zip(&targets.targets).enumerate();
            let refused = refused.filter(|(_, (outcome, _))| outcome.is_err());
            let (places, meant): (Vec<usize>, Vec<Target>) = refused
                .filter_map(|(place, (_, target))| Some((place, slip.undone(target)?)))
                .unzip();
            if meant.is_empty() {
                continue;
            }
            let without = self.compensate(&meant, allow, Covariances::Omitted);
            for (place, _) in places.iter().zip(&without).filter(|(_, own)| own.is_ok()) {
                if let Err(refused) = &mut outcomes[*place] {
                    refused.slip = Some(slip);
                }
            }
        }
    }

    /// The measured region as text: joint ranges, arm configurations, the reflector.
    pub(super) fn measured(&self) -> String {
        let (joints, configurations) = match self {
            Self::Table(own) => {
                let configuration = own.table.terms().configuration.as_deref();
                let nodes =
                    configuration.map(|own| format!("nodes in arm configuration {own:?}; "));
                (&own.measured, nodes)
            }
            Self::Arm(own) => {
                let all = &own.arm.configurations;
                let stations = format!("stations in arm configuration {}; ", all.join(", "));
                (&own.arm.measured, Some(stations).filter(|_| !all.is_empty()))
            }
        };
        let configurations = configurations.unwrap_or_default();
        let units = match self {
            Self::Table(own) => own.units.clone(),
            Self::Arm(own) => JointUnits::of(&own.arm.arm, AngleUnit::Deg),
        };
        let (joints, reflector) = (ranges(joints, &units), self.reflector());
        format!("{configurations}measured with joints {joints}, the {reflector}")
    }

    /// The measured target's place in words.
    pub(super) fn reflector(&self) -> String {
        let at = match self {
            Self::Table(own) => own.flange_from_target.coords(),
            Self::Arm(own) => own.arm.frames.flange_from_target.origin().coords(),
        };
        format!("reflector at ({:.2}, {:.2}, {:.2}) mm on the flange", at.x, at.y, at.z)
    }

    /// The identity of the correction, which every row of the result repeats.
    pub(super) fn by<'a>(&'a self, joint_names: &'a [String]) -> CorrectedBy<'a> {
        let (key, table_id, table) = match self {
            Self::Table(own) => {
                (&own.key, &own.table.terms().table_id, CorrectingTable::Compensation)
            }
            Self::Arm(own) => (&own.key, &own.arm.table_id, CorrectingTable::Calibrations),
        };
        CorrectedBy { key, table_id, table, joint_names }
    }

    /// Joint names in the order of corrected joint angles; empty for a compensation table, which knows positions only.
    pub(super) fn joint_names(&self) -> Vec<String> {
        match self {
            Self::Table(_) => Vec::new(),
            Self::Arm(own) => own.arm.arm.joints().iter().map(|joint| joint.name.clone()).collect(),
        }
    }

    pub const fn validity(&self) -> &Validity {
        match self {
            Self::Table(own) => &own.table.terms().validity,
            Self::Arm(own) => &own.arm.validity,
        }
    }

    pub(super) const fn what(&self) -> &'static str {
        match self {
            Self::Table(_) => "table",
            Self::Arm(_) => "identified arm",
        }
    }

    /// The base that the correction holds in, and where it was fitted what to type for it, a line each.
    pub(super) fn frame(&self) -> Vec<String> {
        match self {
            Self::Table(own) => own.error_frame.lines(),
            Self::Arm(own) => own.error_frame.lines(),
        }
    }

    /// Mean errors before, by a table and by the identified arm, in words.
    pub(super) fn table_and_arm(&self) -> Option<&str> {
        match self {
            Self::Table(own) => own.table_and_arm.as_deref(),
            Self::Arm(_) => None,
        }
    }

    pub(super) const fn verdict(&self) -> TableVerdict {
        match self {
            Self::Table(own) => own.verdict,
            Self::Arm(own) => own.verdict,
        }
    }

    pub(super) fn warnings(&self, targets: &[Target]) -> Vec<String> {
        let fault = match self.verdict() {
            TableVerdict::Met => None,
            TableVerdict::NotMet => Some("does not meet"),
            TableVerdict::NotShown => Some("was not shown to meet"),
        };
        let fault = fault.map(|fault| {
            let what = self.what();
            format!(
                "this {what} {fault} its pipeline's tolerance, and that is allowed: see runs.reason"
            )
        });
        let mut warnings = Vec::from_iter(fault);
        if matches!(self, Self::Arm(_)) {
            return warnings;
        }
        let unturned = targets.iter().filter(|target| target.orientation.is_none()).count();
        if unturned > 0 {
            warnings.push(format!(
                "{unturned} targets state no orientation and are taken to have the table's"
            ));
        }
        let with_joints = targets.iter().filter(|target| target.joints.is_some()).count();
        if with_joints > 0 {
            warnings.push(format!(
                "joint angles of {with_joints} targets are without effect: this table knows positions; table calibrations of \
                 the same run corrects them"
            ));
        }
        warnings
    }
}

/// Lowest and highest angle of each joint, degrees; mm where it slides.
fn ranges(spans: &[[f64; 2]], units: &JointUnits) -> String {
    let range = |(joint, &[low, high]): (usize, &[f64; 2])| {
        if units.slides().get(joint) == Some(&true) {
            return format!("{low:.1} mm to {high:.1} mm");
        }
        format!("{:.1}° to {:.1}°", low.to_degrees(), high.to_degrees())
    };
    spans.iter().enumerate().map(range).collect::<Vec<_>>().join(", ")
}
