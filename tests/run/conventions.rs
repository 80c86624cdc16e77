//! One session under robot files of every convention: the same arm, the same figures.

use std::fs;

use posegrid::kinematics::{Convention, RobotFile};

use super::cell::Cell;

/// The quickstart's session, identified under its robot file in every convention; geometry alone.
pub fn every_one() -> Cell {
    let mut cell = Cell::new().with("harmonics = 12", "enabled = false");
    let path = cell.path("robots/kr210-r2700-extra.toml");
    let text = fs::read_to_string(&path).expect("a robot file");
    let stated: RobotFile = toml::from_str(&text).expect("a robot file");
    let mut means = Vec::new();
    for convention in Convention::ALL {
        let restated = stated.restated(convention).expect("the same arm");
        fs::write(&path, toml::to_string(&restated).expect("TOML")).expect("writable");
        let session = convention.word();
        cell = cell.with_quickstart(session);
        let ended = cell.run(&[session]);
        assert!([0, 3].contains(&ended.code), "{convention:?}: {}", ended.messages);
        means.push(held_out_mean(&cell, session));
    }
    // Each convention has the weak prior on parameters of its own.
    let apart = |mean: &f64| (mean - means[0]).abs();
    assert!(means.iter().all(|mean| apart(mean) < 2e-3), "{means:?}");
    cell
}

/// Mean error that the geometry leaves on held-out blocks of a session, mm.
fn held_out_mean(cell: &Cell, session: &str) -> f64 {
    let table = cell.table("accuracy", session);
    let row = (0..table.rows()).find(|&row| {
        let is = |column: &str, word: &str| table.text(column).value(row) == word;
        is("split", "blocks")
            && is("model", "geometric")
            && is("moment", "after")
            && is("quantity", "position_error")
            && is("name", "mean")
    });
    table.f64("value").value(row.expect("a figure"))
}
