//! Rows of ISO 9283's figures, under the standard's names.

use super::Row;
use crate::report::iso_9283::{Characteristic, Figure, Iso9283};

/// The rows of all figures.
pub(super) fn rows(all: &[Iso9283]) -> impl Iterator<Item = Row<'_>> {
    all.iter()
        .flat_map(|of| of.figures.iter().map(move |figure| row(of, figure)))
}

fn row<'a>(of: &'a Iso9283, figure: &'a Figure) -> Row<'a> {
    let is_angle = figure.characteristic.is_angle();
    Row {
        subject: &of.subject,
        point: of.point,
        moment: of.moment,
        table_id: of.driven_by.clone(),
        quantity: "iso_9283",
        name: name(figure.characteristic),
        pose: figure.pose,
        value: figure.value,
        unit: if is_angle { "rad" } else { "mm" },
        expanded_uncertainty: (!is_angle).then_some(of.expanded_uncertainty_mm),
        n: figure.n,
        visits: None,
        blocks: None,
        n_needed: i64::try_from(figure.n_needed).ok(),
        reason: figure.remark.clone(),
        verdict: None,
    }
}

const fn name(characteristic: Characteristic) -> &'static str {
    match characteristic {
        Characteristic::ApP => "AP_p",
        Characteristic::ApX => "AP_x",
        Characteristic::ApY => "AP_y",
        Characteristic::ApZ => "AP_z",
        Characteristic::ApA => "AP_a",
        Characteristic::ApB => "AP_b",
        Characteristic::ApC => "AP_c",
        Characteristic::RpL => "RP_l",
        Characteristic::RpA => "RP_a",
        Characteristic::RpB => "RP_b",
        Characteristic::RpC => "RP_c",
        Characteristic::AdP => "AD_p",
        Characteristic::AdX => "AD_x",
        Characteristic::AdY => "AD_y",
        Characteristic::AdZ => "AD_z",
        Characteristic::Rd => "RD",
        Characteristic::VapP => "vAP_p",
        Characteristic::DapP => "dAP_p",
    }
}
