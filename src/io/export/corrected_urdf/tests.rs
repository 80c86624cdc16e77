use super::*;

/// The text of the only joint with another origin: (1, 2, 3) m and a turn about x.
fn changed(text: &str) -> String {
    let whole = format!("<robot name=\"r\">{text}</robot>");
    let document = urdf::document(&whole).unwrap();
    let joint = document.root_element().first_element_child().unwrap();
    let origin = crate::geometry::isometry_from_rpy([1000.0, 2000.0, 3000.0], [0.5, 0.0, 0.0]);
    let all = edits(&whole, joint, &origin);
    let out = edited(&whole, all);
    let out = out.strip_prefix("<robot name=\"r\">").unwrap();
    out.strip_suffix("</robot>").unwrap().to_owned()
}

#[test]
fn attributes_of_an_origin_are_changed_or_added_and_nothing_else() {
    for (before, after) in [
        (
            "<joint><origin rpy = '0 0 0'   xyz=\"0\t0 0\" /><axis/></joint>",
            "<joint><origin rpy = '0.5 0 0'   xyz=\"1 2 3\" /><axis/></joint>",
        ),
        (
            "<joint><origin xyz=\"0 0 0\"/></joint>",
            "<joint><origin xyz=\"1 2 3\" rpy=\"0.5 0 0\"/></joint>",
        ),
        ("<joint><origin/></joint>", "<joint><origin xyz=\"1 2 3\" rpy=\"0.5 0 0\"/></joint>"),
        (
            "<joint><origin></origin></joint>",
            "<joint><origin xyz=\"1 2 3\" rpy=\"0.5 0 0\"></origin></joint>",
        ),
        (
            "<joint>\r\n  <!-- none -->\r\n  <axis/></joint>",
            "<joint>\r\n  <!-- none -->\r\n  <origin xyz=\"1 2 3\" rpy=\"0.5 0 0\"/>\r\n  <axis/></joint>",
        ),
    ] {
        assert_eq!(changed(before), after);
    }
}

#[test]
fn another_encoding_that_is_stated_becomes_that_of_what_is_written() {
    let of = |text: &str| encoding(text).map(|edit| edited(text, vec![edit]));
    let other = of("\u{feff}<?xml version='1.0' encoding = 'UTF-16'?><robot/>");
    assert_eq!(other.as_deref(), Some("\u{feff}<?xml version='1.0' encoding = 'UTF-8'?><robot/>"));
    for text in
        ["<?xml version=\"1.0\" encoding=\"utf-8\"?>", "<?xml version=\"1.0\"?>", "<robot/>"]
    {
        assert_eq!(of(text), None, "{text}");
    }
}
