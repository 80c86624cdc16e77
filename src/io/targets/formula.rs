//! Texts in CSV that a spreadsheet would run as a formula are written with a `'` before them, which spreadsheets show
//! as text and [`unmarked`] removes; a text that already begins so gets one more, so that every text is read back
//! unchanged.

const BEGIN: [char; 6] = ['=', '+', '-', '@', '\t', '\r'];
const MARK: char = '\'';

/// Whether a text is taken for a formula, or looks like one that is marked already.
fn is_marked_or_formula(text: &str) -> bool {
    text.trim_start_matches(MARK).starts_with(BEGIN)
}

/// A text as a cell that no spreadsheet runs.
pub(crate) fn marked(text: String) -> String {
    if is_marked_or_formula(&text) { format!("{MARK}{text}") } else { text }
}

/// The text of such a cell.
pub(super) fn unmarked(cell: &str) -> &str {
    let own = cell.strip_prefix(MARK);
    own.filter(|own| is_marked_or_formula(own)).unwrap_or(cell)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_text_comes_back_and_none_begins_a_formula() {
        let texts = [
            "=cmd|' /C calc'!A0",
            "+1",
            "-hole",
            "@SUM(A1)",
            "\t=1",
            "\r=1",
            "'=1",
            "''-1",
            "'quoted'",
            "A-1",
            "",
            "'",
        ];
        for text in texts {
            let cell = marked(text.to_owned());
            assert!(!cell.starts_with(BEGIN), "{cell}");
            assert_eq!(unmarked(&cell), text);
        }
        assert_eq!(marked("A=1".to_owned()), "A=1");
        assert_eq!(unmarked("'quoted'"), "'quoted'", "not of ours");
    }
}
