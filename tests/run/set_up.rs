//! A set-up that the logs contradict: named first, with the key to edit, before anything is published.

use super::cell::{Cell, ended, files, posegrid};

const COMMANDS: &str = "base_from_command = { xyz_mm = [0, 0, 0], quaternion_xyzw = [0, 0, 0, 1] }";
const TOOL: &str = "flange_from_tool = { xyz_mm = [25, -40, 100], quaternion_xyzw = [0, 0, 0, 1] }";

/// Two mistakes in the quickstart's pipeline file, with words of the message that names them; `tests/readers/wrong_set_ups.py` has every kind.
const MISTAKES: [(&str, &str, &str); 2] = [
    (
        COMMANDS,
        "base_from_command = { xyz_mm = [0, 0, 0], quaternion_xyzw = [0, 0, 1, 0] }",
        "[commanded] base_from_command is turned by 180° about z",
    ),
    (
        "unit = \"m\"\ntemperature",
        "unit = \"mm\"\ntemperature",
        "the tracker's positions are in m; write [tracker] unit = \"m\"",
    ),
];

#[test]
fn a_wrong_set_up_has_no_result_and_is_named() {
    for (stated, wrong, named) in MISTAKES {
        let cell = Cell::new().with_quickstart("mon").with(stated, wrong);
        let ended = cell.run(&[]);
        assert_eq!(ended.code, 1, "{named}: {}{}", ended.results, ended.messages);
        let said = ended.results + &ended.messages;
        let first = said.split("the logs cannot separate").next().unwrap_or_default();
        assert!(first.contains(named), "{named}: {said}");
        assert!(files(&cell.path("lake/runs")).is_empty(), "{named}: a run was published");
    }
}

#[test]
fn logs_of_two_sessions_are_not_blamed_on_the_set_up() {
    let cell = Cell::new().with_quickstart("mon").with_simulated("tue", &["--random", "80"]);
    let from = cell.session("tue").join("tracker.mcap");
    std::fs::copy(from, cell.session("mon").join("tracker.mcap")).expect("copied");
    let ended = cell.run(&["mon"]);
    assert_eq!(ended.code, 1, "{}", ended.results);
    let said = ended.results + &ended.messages;
    assert!(said.contains("probably logs of two sessions"), "{said}");
}

#[test]
fn a_small_disagreement_is_published_with_a_warning() {
    let off = "flange_from_tool = { xyz_mm = [25, -40, 104], quaternion_xyzw = [0, 0, 0, 1] }";
    let cell = Cell::new().with_quickstart("mon").with(TOOL, off);
    let ended = cell.run(&[]);
    assert!(matches!(ended.code, 0 | 3), "{}{}", ended.results, ended.messages);
    let named = "[commanded] flange_from_tool is off by [0.0, 0.0, -4.0] mm";
    assert!(ended.results.contains(named), "{}", ended.results);
    // It comes before what is to be done with the result, in the summary and on the page.
    let first = "heck the set-up first, as the warning says";
    assert!(ended.results.contains(&format!("now: c{first}")), "{}", ended.results);
    let page = files(&cell.path("lake/report")).into_values().next().expect("a page");
    let page = String::from_utf8(page).expect("UTF-8");
    assert!(page.contains(named), "the page does not warn");
    assert!(page.contains(&format!("C{first}")), "the page goes on as if nothing were");
}

#[test]
fn check_shows_where_the_nominal_flange_is_and_what_the_file_contradicts() {
    let target = "target = { xyz_mm = [25, -40, 100], sd_mm = 0.2 }";
    let cell = Cell::new()
        .with_quickstart("mon")
        .with(target, "target = { xyz_mm = [25, -40, 180], sd_mm = 0.2 }");
    let ended = ended(posegrid().arg("check").arg(cell.pipeline()));
    assert_eq!(ended.code, 0, "{}{}", ended.results, ended.messages);
    assert!(
        ended
            .results
            .contains("flange at home (0, -90, 90, 0, 0, 0°): [1765.000, 0.000, 1784.000] mm"),
        "{}",
        ended.results
    );
    assert!(ended.results.contains("flange at zero (0, 0, 0, 0, 0, 0°)"), "{}", ended.results);
    assert!(ended.results.contains("outside the limits of joint_a2"), "{}", ended.results);
    assert!(ended.results.contains("are 80.0 mm apart, but target_is_tool"), "{}", ended.results);
}
