//! Retries of a request: while the storage answers, up to [`PATIENCE`]; storage that has not answered yet is
//! asked [`RETRIES`] times more, within a second, so that a wrong address is reported at once.

use std::env;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use object_store::aws::{AmazonS3, AmazonS3Builder};
use object_store::{BackoffConfig, Error, RetryConfig};

use super::trouble;
use super::whole::Whole;

pub(super) const RETRIES: usize = 3;
const PATIENCE: Duration = Duration::from_secs(90);
/// Pauses between retries: they grow from the first to the last, by a factor of up to the third.
const PAUSES: (Duration, Duration, f64) = (Duration::from_millis(250), Duration::from_secs(8), 3.0);
/// The variable that bounds the attempts of a request, as the storage's own clients have it.
const MOST_ATTEMPTS: &str = "AWS_MAX_ATTEMPTS";

/// Whether the storage answered last. All buckets of a process are reached at one address.
static ANSWERS: AtomicBool = AtomicBool::new(false);

pub(super) struct Clients {
    brief: AmazonS3,
    patient: AmazonS3,
}

impl Clients {
    pub fn of(builder: &AmazonS3Builder) -> Result<Self, Error> {
        let retrying = |retry| builder.clone().with_http_connector(Whole).with_retry(retry).build();
        let (init_backoff, max_backoff, base) = PAUSES;
        Ok(Self {
            brief: retrying(RetryConfig {
                max_retries: RETRIES,
                retry_timeout: PATIENCE,
                ..RetryConfig::default()
            })?,
            patient: retrying(RetryConfig {
                max_retries: most_attempts().saturating_sub(1),
                retry_timeout: PATIENCE,
                backoff: BackoffConfig { init_backoff, max_backoff, base },
            })?,
        })
    }

    pub fn now(&self) -> &AmazonS3 {
        if ANSWERS.load(Ordering::Relaxed) { &self.patient } else { &self.brief }
    }
}

pub(super) fn noted<T>(answer: Result<T, Error>) -> Result<T, Error> {
    match &answer {
        Ok(_) => ANSWERS.store(true, Ordering::Relaxed),
        Err(error) if trouble::is_outage(error) => ANSWERS.store(false, Ordering::Relaxed),
        Err(_) => {}
    }
    answer
}

/// The attempts of a request, at most; as many as [`PATIENCE`] has time for where the environment states no number.
fn most_attempts() -> usize {
    let stated = env::var(MOST_ATTEMPTS).ok();
    stated.and_then(|text| text.trim().parse().ok()).unwrap_or(usize::MAX)
}
