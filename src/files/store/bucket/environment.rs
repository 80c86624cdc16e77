//! The environment → the clients of a bucket. Credentials come from `AWS_…` variables and from nowhere else. A missing
//! variable is reported before any request.

use std::env;

use object_store::aws::{AmazonS3Builder, AmazonS3ConfigKey, S3ConditionalPut};
use object_store::client::ClientConfigKey;

use super::patience::Clients;
use super::trouble::{self, Secrets};
use super::{Place, StoreError};

/// Variables that name another source of credentials, so that the two variables of a key are not needed.
const OTHER_CREDENTIALS: [&str; 5] = [
    "AWS_WEB_IDENTITY_TOKEN_FILE",
    "AWS_CONTAINER_CREDENTIALS_RELATIVE_URI",
    "AWS_CONTAINER_CREDENTIALS_FULL_URI",
    "AWS_METADATA_ENDPOINT",
    "AWS_SKIP_SIGNATURE",
];
/// Variables with the address of the storage, if it is not Amazon's own.
const ENDPOINTS: [&str; 3] = ["AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL", "AWS_ENDPOINT"];

pub(super) fn clients(place: &Place) -> Result<(Clients, Secrets), StoreError> {
    let bucket = bucket(place)?;
    let builder = AmazonS3Builder::from_env();
    check(place, &builder)?;
    let secrets = Secrets::of(&builder);
    // TLS by ring for the whole process; for a second client it is installed already.
    let _ = rustls::crypto::ring::default_provider().install_default();
    let builder =
        builder.with_bucket_name(bucket).with_conditional_put(S3ConditionalPut::ETagMatch);
    let clients = Clients::of(&builder);
    let clients =
        clients.map_err(|error| trouble::failure("reach", place.clone(), &error, &secrets))?;
    Ok((clients, secrets))
}

fn bucket(place: &Place) -> Result<&str, StoreError> {
    let (bucket, prefix) = place.bucket().expect("an address");
    let problem = if bucket.contains('@') {
        "it holds a key and a secret, which belong in AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY; change them, since addresses are logged"
    } else if bucket.is_empty() {
        "it names no bucket"
    } else if !bucket.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-._".contains(&byte)) {
        "a bucket's name holds letters, digits, `-` and `.` only"
    } else if prefix.split('/').any(|part| part.is_empty() && !prefix.is_empty()) {
        "two slashes follow one another"
    } else {
        return Ok(bucket);
    };
    Err(StoreError::Address { place: place.clone(), problem })
}

fn check(place: &Place, builder: &AmazonS3Builder) -> Result<(), StoreError> {
    let wrong = |variable, problem| {
        Err(StoreError::Environment { place: place.clone(), variable, problem })
    };
    let is_set = |name: &&str| env::var_os(name).is_some_and(|value| !value.is_empty());
    if !OTHER_CREDENTIALS.iter().any(is_set) {
        let key = ["AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"];
        if let Some(missing) = key.into_iter().find(|name| !is_set(name)) {
            return wrong(
                missing,
                "is not set: credentials come from the environment; set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY",
            );
        }
    }
    let Some(variable) = ENDPOINTS.into_iter().find(is_set) else { return Ok(()) };
    let endpoint = env::var(variable).unwrap_or_default();
    let Some((scheme, rest)) = endpoint.split_once("://") else {
        return wrong(variable, "is no address: write https://HOST:PORT");
    };
    if rest.split('/').next().is_some_and(|host| host.contains('@')) {
        return wrong(
            variable,
            "holds a name and password, which belong in AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY",
        );
    }
    let may_http = AmazonS3ConfigKey::Client(ClientConfigKey::AllowHttp);
    if scheme == "http" && builder.get_config_value(&may_http).as_deref() != Some("true") {
        return wrong(
            variable,
            "begins with http://, which anybody on the way can read: where that network is your own set AWS_ALLOW_HTTP=true",
        );
    }
    Ok(())
}
