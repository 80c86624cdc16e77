//! JSON messages.

/// What a string says whose escapes are JSON's; `None` where they are none.
pub(super) fn unescaped(bytes: &[u8]) -> Option<String> {
    let text = str::from_utf8(bytes).ok()?;
    serde_json::from_str(&format!("\"{text}\"")).ok()
}
