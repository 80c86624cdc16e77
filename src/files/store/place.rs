use std::borrow::Cow;
use std::fmt;
use std::path::{Path, PathBuf};

const SCHEME: &str = "s3://";

/// A path, or an address `s3://BUCKET/KEY`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Place {
    Path(PathBuf),
    Url(String),
}

impl Place {
    /// The place that a user wrote: an address if it begins with `s3://`, otherwise a path.
    pub fn of(written: impl Into<PathBuf>) -> Self {
        let path = written.into();
        match path.to_str().and_then(|text| text.strip_prefix(SCHEME)) {
            Some(_) => {
                let url = without_secrets(path.to_str().unwrap_or_default());
                let rest = url.strip_prefix(SCHEME).unwrap_or_default();
                Self::Url(format!("{SCHEME}{}", rest.trim_end_matches('/')))
            }
            None => Self::Path(path),
        }
    }

    /// The path; `None` for an address.
    pub fn as_path(&self) -> Option<&Path> {
        match self {
            Self::Path(path) => Some(path),
            Self::Url(_) => None,
        }
    }

    /// The place in the form of a path, for display: that of an address names it and cannot be opened.
    pub fn named(&self) -> PathBuf {
        match self {
            Self::Path(path) => path.clone(),
            Self::Url(url) => PathBuf::from(url),
        }
    }

    pub fn stem(&self) -> String {
        let named = self.named();
        let stem = named.file_stem().unwrap_or_default();
        stem.to_string_lossy().into_owned()
    }

    #[must_use]
    pub fn join(&self, key: &str) -> Self {
        match self {
            _ if key.is_empty() => self.clone(),
            Self::Path(path) => Self::Path(path.join(key)),
            Self::Url(url) => Self::Url(format!("{url}/{key}")),
        }
    }

    /// Bucket and prefix of an address: `s3://BUCKET/PREFIX`.
    pub fn bucket(&self) -> Option<(&str, &str)> {
        let Self::Url(url) = self else { return None };
        let rest = url.strip_prefix(SCHEME)?;
        Some(rest.split_once('/').unwrap_or((rest, "")))
    }

    pub const fn display(&self) -> &Self {
        self
    }
}

/// A text without the credentials that stand before the `@` of an address in it.
pub fn without_secrets(text: &str) -> Cow<'_, str> {
    // A path made of an address has one stroke.
    let schemes = ["s3:/", "S3:/", "http:/", "https:/"];
    if !text.contains('@') || !schemes.iter().any(|scheme| text.contains(scheme)) {
        return Cow::Borrowed(text);
    }
    let hidden = |text: String, scheme: &&str| {
        let mut parts = text.split(scheme);
        let first = parts.next().unwrap_or_default().to_owned();
        parts.fold(first, |shown, part| shown + scheme + &without_user(part))
    };
    Cow::Owned(schemes.iter().fold(text.to_owned(), hidden))
}

/// What stands behind a scheme without what is before its `@`.
fn without_user(part: &str) -> String {
    let (strokes, rest) = part.split_at(part.len() - part.trim_start_matches('/').len());
    let address = rest.split_whitespace().next().unwrap_or_default();
    match address.rfind('@') {
        Some(at) => format!("{strokes}…{}", &rest[at..]),
        None => part.to_owned(),
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Path(path) => path.display().fmt(f),
            Self::Url(url) => url.fmt(f),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_shows_as_it_was_written_and_keys_stand_below_it() {
        let path = Place::of("lake");
        assert_eq!(path.join("runs/a").to_string(), "lake/runs/a");
        assert_eq!(path.bucket(), None);
        let url = Place::of("s3://bucket/some/lake/");
        assert_eq!(url.join("runs/a.parquet").to_string(), "s3://bucket/some/lake/runs/a.parquet");
        assert_eq!(url.join("runs/a.parquet").stem(), "a");
        assert_eq!(url.bucket(), Some(("bucket", "some/lake")));
        assert_eq!(Place::of("s3://bucket/").bucket(), Some(("bucket", "")));
        assert_eq!(Place::of("s3://").bucket(), Some(("", "")));
        assert_eq!(Place::of("s3://KEY:SE/C@bucket/a/").to_string(), "s3://…@bucket/a");
        let text = "no s3:/K:S@b/x, https://u:p@h/y nor C:/a@b or a@b";
        assert_eq!(without_secrets(text), "no s3:/…@b/x, https://…@h/y nor C:/a@b or a@b");
        assert_eq!(url.as_path(), None);
        // A folder with this name is a path: only the whole scheme makes an address.
        assert!(Place::of("s3:/x").as_path().is_some());
    }
}
