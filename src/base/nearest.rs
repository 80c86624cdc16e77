//! What somebody meant who wrote a name that is not there.

use strsim::osa_distance;

/// ` (did you mean "unit"?)` of the known name that begins so, or differs by the fewest letters, at most a third of them; else nothing.
pub fn did_you_mean<'n>(word: &str, known: impl IntoIterator<Item = &'n str>) -> String {
    let letters = |name: &str| osa_distance(&word.to_lowercase(), &name.to_lowercase());
    let begins = |name: &str| word.len() >= LEAST && name.starts_with(word);
    let nearest = known.into_iter().min_by_key(|name| (!begins(name), letters(name)));
    let is_near = |name: &&str| begins(name) || 3 * letters(name) <= name.len().max(LEAST);
    nearest.filter(is_near).map_or_else(String::new, |name| format!(" (did you mean {name:?}?)"))
}

/// Fewer letters tell nothing.
const LEAST: usize = 3;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_meant_where_few_letters_differ() {
        let known = ["topic", "time", "unit", "tracker_from_base"];
        assert_eq!(did_you_mean("untit", known), " (did you mean \"unit\"?)");
        assert_eq!(did_you_mean("Unit", known), " (did you mean \"unit\"?)");
        assert_eq!(
            did_you_mean("trackr_from_bse", known),
            " (did you mean \"tracker_from_base\"?)"
        );
        assert_eq!(did_you_mean("tracker", known), " (did you mean \"tracker_from_base\"?)");
        assert_eq!(did_you_mean("robot", known), "");
        assert_eq!(did_you_mean("x", []), "");
    }
}
