//! An answer of the storage → an error with advice. An answer may quote the request with its session token: only
//! status, code and message are used, and secrets are removed from those too.

use object_store::Error;
use object_store::aws::{AmazonS3Builder, AmazonS3ConfigKey};
use object_store::client::{HttpError, HttpErrorKind};

use super::{Place, StoreError};
use crate::store::BucketTrouble;

const CHANGED: &str = "it changed meanwhile";
const LONGEST: usize = 300;

#[derive(Default)]
pub(super) struct Secrets(Vec<String>);

impl Secrets {
    pub(super) fn of(builder: &AmazonS3Builder) -> Self {
        let keys = [
            AmazonS3ConfigKey::SecretAccessKey,
            AmazonS3ConfigKey::Token,
            AmazonS3ConfigKey::AccessKeyId,
        ];
        let values = keys.iter().filter_map(|key| builder.get_config_value(key));
        Self(values.filter(|value| !value.is_empty()).collect())
    }

    fn struck_from(&self, text: &str) -> String {
        let struck = |text: String, secret: &String| text.replace(secret, "…");
        self.0.iter().fold(text.to_owned(), struck)
    }
}

pub(super) fn failure(
    doing: &'static str,
    place: Place,
    error: &Error,
    secrets: &Secrets,
) -> StoreError {
    let (reason, trouble) = read(error);
    let reason: String = secrets
        .struck_from(&reason)
        .chars()
        .map(|c| if c.is_control() { ' ' } else { c })
        .take(LONGEST)
        .collect();
    StoreError::Bucket { doing, place, reason, trouble }
}

pub(super) fn missing(doing: &'static str, place: Place) -> StoreError {
    let reason = "there is no such object".to_owned();
    StoreError::Bucket { doing, place, reason, trouble: BucketTrouble::NoObject }
}

pub(super) fn changed(doing: &'static str, place: Place) -> StoreError {
    StoreError::Bucket { doing, place, reason: CHANGED.to_owned(), trouble: BucketTrouble::Changed }
}

/// Whether the storage did not answer, or could not serve the request.
pub(super) fn is_outage(error: &Error) -> bool {
    read(error).1 == BucketTrouble::NoAnswer
}

fn read(error: &Error) -> (String, BucketTrouble) {
    if let Some(root) = on_the_way(error) {
        return (format!("no answer: {root}"), BucketTrouble::NoAnswer);
    }
    let text = error.to_string();
    let code = between(&text, "<Code>", "</Code>");
    let message = between(&text, "<Message>", "</Message>");
    let status = between(&text, "status code: ", ":");
    let said: Vec<&str> = [status, code, message].into_iter().flatten().collect();
    let trouble = match error {
        _ if code == Some("NoSuchBucket") => BucketTrouble::NoBucket,
        _ if status.is_some() => by_status(status.unwrap_or_default(), code),
        Error::NotFound { .. } => BucketTrouble::NoObject,
        Error::Precondition { .. } | Error::NotModified { .. } => BucketTrouble::Changed,
        _ => BucketTrouble::Other,
    };
    let reason = match error {
        _ if trouble == BucketTrouble::Changed => CHANGED.to_owned(),
        Error::InvalidPath { source } => {
            format!("an object there has a name that cannot be used: {source}")
        }
        _ if said.is_empty() => {
            // Before it begins to quote.
            text.split('<').next().unwrap_or_default().trim().to_owned()
        }
        _ => said.join(", "),
    };
    (reason, trouble)
}

/// Whether a request may have been served although its answer was lost.
pub(super) fn is_answer_lost(error: &Error) -> bool {
    use HttpErrorKind::{Connect, Request};
    let mut cause: &dyn std::error::Error = error;
    while let Some(next) = cause.source() {
        cause = next;
        if let Some(error) = cause.downcast_ref::<HttpError>() {
            return !matches!(error.kind(), Connect | Request);
        }
    }
    false
}

fn by_status(status: &str, code: Option<&str>) -> BucketTrouble {
    let refused = ["AuthorizationHeaderMalformed", "InvalidToken", "ExpiredToken"];
    match status.get(..3).unwrap_or_default() {
        _ if code.is_some_and(|code| code == "RequestTimeTooSkewed") => BucketTrouble::Clock,
        "401" | "403" => BucketTrouble::Refused,
        "404" => BucketTrouble::NoObject,
        "304" | "412" => BucketTrouble::Changed,
        "408" | "429" => BucketTrouble::NoAnswer,
        "501" => BucketTrouble::Other,
        number if number.starts_with('5') => BucketTrouble::NoAnswer,
        _ if code.is_some_and(|code| refused.contains(&code)) => BucketTrouble::Refused,
        _ => BucketTrouble::Other,
    }
}

/// The cause of a failure without an answer: the deepest one, as the others only state that there is one.
fn on_the_way(error: &Error) -> Option<String> {
    let mut cause: &dyn std::error::Error = error;
    let mut is_http = false;
    while let Some(next) = cause.source() {
        cause = next;
        is_http |= cause.is::<HttpError>();
    }
    is_http.then(|| cause.to_string())
}

fn between<'a>(text: &'a str, before: &str, after: &str) -> Option<&'a str> {
    let rest = text.split_once(before)?.1;
    Some(rest.split_once(after)?.0.trim())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(body: &str) -> String {
        answered("403 Forbidden", body)
    }

    fn answered(status: &str, body: &str) -> String {
        let error = Error::Generic {
            store: "S3",
            source: format!("Server returned non-2xx status code: {status}: {body}").into(),
        };
        let secrets = Secrets(vec!["hush-hush".to_owned()]);
        failure("read", Place::of("s3://b/a"), &error, &secrets).to_string()
    }

    #[test]
    fn an_answer_that_quotes_the_request_is_reported_without_it() {
        // Amazon's answer to a wrong signature: the canonical request holds the session token.
        let text = refused(
            "<Error><Code>SignatureDoesNotMatch</Code><Message>The signature of\nhush-hush</Message>\
             <CanonicalRequest>x-amz-security-token:hush-hush</CanonicalRequest></Error>",
        );
        assert!(
            text.starts_with(
                "cannot read s3://b/a: 403 Forbidden, SignatureDoesNotMatch, The signature of …; check AWS_ACCESS_KEY_ID"
            ),
            "{text}"
        );
        assert!(!text.contains("hush") && !text.contains("x-amz"), "{text}");
    }

    #[test]
    fn an_answer_of_another_form_is_cut_where_it_quotes() {
        let text = refused("<html>hush-hush</html>");
        assert!(text.contains("403 Forbidden") && !text.contains("html"), "{text}");
        assert!(refused(&"x".repeat(5000)).len() < 600);
    }

    #[test]
    fn each_kind_of_trouble_has_its_advice() {
        let no_bucket = "<Error><Code>NoSuchBucket</Code></Error>";
        for (status, body, advice) in [
            ("404 Not Found", no_bucket, "make the bucket"),
            ("404 Not Found", "", "check the name"),
            ("503 Service Unavailable", "", "run again"),
            ("412 Precondition Failed", "", "wait until nobody writes there"),
            ("501 Not Implemented", "", "conditional put"),
            ("400 Bad Request", "<Code>ExpiredToken</Code>", "check AWS_ACCESS_KEY_ID"),
            ("400 Bad Request", "", "conditional put"),
            ("403 Forbidden", "<Code>RequestTimeTooSkewed</Code>", "set this machine's clock"),
        ] {
            let text = answered(status, body);
            assert!(text.contains(advice), "{status}: {text}");
        }
    }
}
