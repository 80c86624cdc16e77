//! Columns with the same value in every row, such as the table's subject.

use arrow_array::{Array, StringArray};
use arrow_buffer::ArrowNativeType;

/// The text of every row, where all have the same; `None` where they differ, some are null or there is no row.
pub(super) fn text(array: &StringArray) -> Option<&str> {
    if array.is_empty() || array.null_count() > 0 {
        return None;
    }
    let first = array.value(0);
    let offsets = array.value_offsets();
    let bytes = &array.value_data()[offsets[0].as_usize()..offsets[array.len()].as_usize()];
    // All texts have one length, and the bytes are the same when shifted by one row.
    let same = array.offsets().lengths().all(|length| length == first.len())
        && bytes[first.len()..] == bytes[..bytes.len() - first.len()];
    same.then_some(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_texts_that_all_rows_share_are_the_same() {
        let text_of = |texts: &[Option<&str>]| {
            let array: StringArray = texts.iter().copied().collect();
            text(&array).map(str::to_owned)
        };
        assert_eq!(text_of(&[Some("ü1"); 5]).as_deref(), Some("ü1"));
        assert_eq!(text_of(&[Some(""); 3]).as_deref(), Some(""));
        assert_eq!(text_of(&[Some("one")]).as_deref(), Some("one"));
        assert_eq!(text_of(&[]), None);
        assert_eq!(text_of(&[None, None]), None);
        assert_eq!(text_of(&[Some("a"), None]), None);
        // The same bytes in sequence, divided differently; the same lengths, other bytes.
        assert_eq!(text_of(&[Some("aa"), Some("a"), Some("aaa")]), None);
        assert_eq!(text_of(&[Some("ab"), Some("ab"), Some("ac")]), None);
        let several: StringArray = ["x", "y", "y", "y", "z"].map(Some).into_iter().collect();
        assert_eq!(text(&several.slice(1, 3)), Some("y"), "a part of a longer array");
    }
}
